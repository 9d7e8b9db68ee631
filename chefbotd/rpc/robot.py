"""What the socket asks of the robot; whoever wires the daemon implements it."""

from collections.abc import Collection, Mapping
from typing import Protocol

from chefbotd.core.commands import Allowed
from chefbotd.core.events import StatsSampled
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.motion.pid import PidParameters


class Robot(Protocol):
    """Called synchronously, so that a stop goes from the socket to the wire in one call stack.

    A method that does not do what it is asked raises ``chefbotd.core.commands.Refused``.
    """

    @property
    def command_timeout_s(self) -> float:
        """For how long a command moves the robot at most: the dead-man's time."""
        ...

    @property
    def let_go_s(self) -> float:
        """A source that a stop holds is free when no command has come from it for so long."""
        ...

    @property
    def default_source(self) -> str:
        """Whose a velocity command is that does not say."""
        ...

    @property
    def sources(self) -> tuple[str, ...]:
        """The configured sources of velocity commands."""
        ...

    @property
    def description(self) -> str | None:
        """The robot's URDF; None where it has none."""
        ...

    def drive(self, source: str, twist: Twist2D) -> Allowed[Twist2D]:
        """Take a velocity command from one of the configured sources; what the limits allow of it."""
        ...

    def set_wheel_velocities(
        self, source: str, velocity_rad_s: Mapping[str, float]
    ) -> Allowed[Mapping[str, float]]:
        """Take a command for each wheel by name; wheels that are not named stand. What the limits allow of it."""
        ...

    def release(self, source: str) -> None:
        """Nobody answers for this source's last command any more: lower sources go on; never refused."""
        ...

    def stop(self, by: str, excluded: Collection[str] = ()) -> None:
        """Come to rest; sources that are driven are held, but for the ``excluded`` ones, whose next drive moves."""
        ...

    def resume(self, sources: Collection[str]) -> None:
        """The drivers of these sources know of the stop and ask anew: nothing holds them any longer."""
        ...

    def estop(self, reason: str) -> None:
        """Stop the motors at once, and until armed again."""
        ...

    def arm(self) -> None:
        """Allow motion."""
        ...

    def pid(self) -> Mapping[str, PidParameters]:
        """The gains by wheel name."""
        ...

    def set_pid(self, wheel: str, changes: Mapping[str, object]) -> Mapping[str, PidParameters]:
        """Change gains of one wheel or of ``"all"``: what every wheel now has."""
        ...

    def undo_pid(self) -> Mapping[str, PidParameters]:
        """Take the latest change of gains back: what every wheel now has."""
        ...

    def set_odometry(self, pose: Pose2D) -> None:
        """Declare ``odom_from_base``."""
        ...

    def reset_board(self) -> None:
        """Restart the board."""
        ...

    def stats(self) -> StatsSampled:
        """The counters as they stand."""
        ...
