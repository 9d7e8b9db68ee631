"""The commands of chefbotctl that drive, stop and arm."""
