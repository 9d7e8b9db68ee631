"""The programs chefbotd and chefbotctl."""
