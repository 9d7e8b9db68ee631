"""The commands of chefbotctl about the wheels' controllers."""
