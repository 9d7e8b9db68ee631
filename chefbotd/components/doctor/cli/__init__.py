"""The commands doctor and ports. Their conclusions are drawn in ``chefbotd.components.doctor``."""
