"""The feature: Foxglove."""

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.features.feature import Feature, Service
from chefbotd.features.foxglove.parameters import FoxgloveParameters
from chefbotd.features.foxglove.server import FoxgloveServer
from chefbotd.features.foxglove.service import FoxgloveService
from chefbotd.features.recording.making import read_map


def foxglove(
    bus: Bus, clock: Clock, parameters: FoxgloveParameters, robot: str, first_scanner: str | None
) -> Feature:
    """What happens, live in Foxglove."""
    service = FoxgloveService(bus, clock, lambda: FoxgloveServer(parameters, robot), first_scanner, read_map)
    return Feature("foxglove", services=(Service("foxglove", service.run),))
