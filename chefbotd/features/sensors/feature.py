"""The feature: the sensors that the robot has."""

from chefbotd.features.feature import Feature, Service
from chefbotd.features.sensors.methods import TOPICS
from chefbotd.features.sensors.service import SensorService


def sensors(service: SensorService) -> Feature:
    """Their readings in SI units, over the service that interprets them."""
    return Feature("sensors", services=(Service("sensors", service.run),), topics=TOPICS)
