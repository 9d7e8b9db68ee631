"""The robot's description, on request."""

from collections.abc import Callable

from chefbotd.driving.description.models import RobotDescription
from chefbotd.features.feature import Feature
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import NoParams
from chefbotd.rpc.parameters import Role


class DescriptionService:
    """``urdf`` returns the URDF document, or None if it cannot be read."""

    def __init__(self, urdf: Callable[[], str | None]) -> None:
        self._urdf = urdf

    @method(role=Role.OBSERVE, for_guests=True)
    def get_description(self, caller: Caller, params: NoParams) -> RobotDescription:
        """The robot's description: its links and joints."""
        return RobotDescription(urdf=self._urdf())


def description(urdf: Callable[[], str | None]) -> Feature:
    """The robot's description; ``urdf`` is as for the service."""
    return Feature("description", methods=methods_of(DescriptionService(urdf)))
