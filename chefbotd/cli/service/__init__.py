"""The commands that install chefbotd as a system service."""
