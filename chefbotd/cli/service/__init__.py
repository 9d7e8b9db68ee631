"""Commands that make chefbotd a service of the computer."""
