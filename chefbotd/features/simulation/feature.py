"""The feature of a simulated robot: its truth."""

from chefbotd.features.feature import Feature
from chefbotd.features.simulation.methods import TOPICS

SIMULATION = Feature("simulation", topics=TOPICS)
