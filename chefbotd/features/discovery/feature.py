"""The feature: discovery."""

from chefbotd.features.discovery.multicast import Multicast
from chefbotd.features.discovery.parameters import DiscoveryParameters
from chefbotd.features.discovery.service import DiscoveryService, Listening
from chefbotd.features.feature import Feature, Service


def discovery(
    parameters: DiscoveryParameters, robot: str, server: Listening, page: Listening | None, *, encrypted: bool
) -> Feature:
    """The robot is found by its name on the local network."""
    service = DiscoveryService(parameters.label(robot), robot, server, page, Multicast(), encrypted=encrypted)
    return Feature("discovery", services=(Service("discovery", service.run),))
