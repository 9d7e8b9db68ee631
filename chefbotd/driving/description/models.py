"""The robot's description: its links and joints."""

from chefbotd.core.record import Record


class RobotDescription(Record, frozen=True):
    """The robot's links and joints as a URDF document; null if its URDF file cannot be read."""

    urdf: str | None
