"""The robot as the command socket knows it: one face for the parts that carry its requests out."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from chefbotd.core.commands import Allowed, RefusalKind, Refused
from chefbotd.core.events import StatsSampled
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.features.driving.service import DriveService
from chefbotd.features.odometry.service import OdometryService
from chefbotd.features.statistics.service import StatsService
from chefbotd.features.tuning.tuning import Tuning
from chefbotd.link.session import BoardSession
from chefbotd.motion.limit_preview import LimitPreview
from chefbotd.motion.pid import PidParameters


@dataclass(frozen=True, slots=True)
class WiredRobot:
    """Implements ``chefbotd.rpc.robot.Robot``."""

    driving: DriveService
    odometry: OdometryService
    session: BoardSession
    statistics: StatsService
    tuning: Tuning
    command_timeout_s: float
    default_source: str
    description: str | None
    sources: tuple[str, ...]
    allowance: LimitPreview
    let_go_s: float

    def drive(self, source: str, twist: Twist2D) -> Allowed[Twist2D]:
        """Take a velocity command."""
        self.driving.command(source, twist)
        return self.allowance.of_twist(twist)

    def set_wheel_velocities(
        self, source: str, velocity_rad_s: Mapping[str, float]
    ) -> Allowed[Mapping[str, float]]:
        """Take a command for each wheel."""
        wanted = self.driving.wheel_velocities(velocity_rad_s)
        self.driving.command(source, wanted)
        return self.allowance.of_wheels(wanted)

    def release(self, source: str) -> None:
        """Forget a source's command."""
        self.driving.release(source)

    def stop(self, by: str, excluded: Collection[str] = ()) -> None:
        """Come to rest, and hold the sources that are driven."""
        self.driving.stop(by, excluded)

    def resume(self, sources: Collection[str]) -> None:
        """Hold these sources no longer."""
        self.driving.resume(sources)

    def estop(self, reason: str) -> None:
        """Brake now, and until armed."""
        self.driving.estop(reason)

    def arm(self) -> None:
        """Allow motion."""
        self.driving.arm()

    def pid(self) -> Mapping[str, PidParameters]:
        """The gains by wheel name."""
        return self.tuning.gains()

    def set_pid(self, wheel: str, changes: Mapping[str, object]) -> Mapping[str, PidParameters]:
        """Change gains."""
        return self.tuning.change(wheel, changes)

    def undo_pid(self) -> Mapping[str, PidParameters]:
        """Take a change of gains back."""
        return self.tuning.undo()

    def set_odometry(self, pose: Pose2D) -> None:
        """Declare where the robot is."""
        self.odometry.set_pose(pose)

    def reset_board(self) -> None:
        """Brake, forget every command, and restart the board.

        Raises:
            Refused: it is not connected.
        """
        if not self.session.is_open:
            raise Refused(RefusalKind.LINK_DOWN, "the board is not connected")
        self.driving.brake()
        self.session.reset_board()

    def stats(self) -> StatsSampled:
        """The counters now."""
        return self.statistics.sample()
