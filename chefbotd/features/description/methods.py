"""The robot's description: its links and joints."""

from collections.abc import Callable

from chefbotd.rpc.method import Caller, method
from chefbotd.rpc.models import NoParams, Result
from chefbotd.rpc.roles import Role


class RobotDescription(Result):
    """The robot's links and joints as a URDF document; null where one of its own cannot be read."""

    urdf: str | None


class DescriptionMethods:
    """``urdf`` gives the document, None where the robot has none."""

    def __init__(self, urdf: Callable[[], str | None]) -> None:
        self._urdf = urdf

    @method(role=Role.OBSERVE)
    def get_description(self, caller: Caller, params: NoParams) -> RobotDescription:
        """The robot's own description: its links and joints."""
        return RobotDescription(urdf=self._urdf())
