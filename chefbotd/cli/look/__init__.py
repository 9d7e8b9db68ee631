"""The commands of chefbotctl that only read."""
