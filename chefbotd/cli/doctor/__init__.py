"""The commands that say what is wrong: doctor and ports. The conclusions are in ``chefbotd.doctor``."""
