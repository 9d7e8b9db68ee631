"""Computes what the limits leave of a command: the target that the robot approaches.

The answer depends on the command alone. Ramps, obstacles, other sources and weak motors may hold it back as well: the
topics tell of these.
"""

from collections.abc import Mapping, Sequence

from chefbotd.core.commands import Allowed
from chefbotd.core.geometry import Twist2D, WheelVelocities
from chefbotd.motion.drive_state import DriveParameters
from chefbotd.motion.kinematics import ChassisParameters, Kinematics
from chefbotd.motion.limits import MotionLimits, within_speeds
from chefbotd.motion.rims import share_of_rims


class LimitPreview:
    """Computes the limits as ``chefbotd.motion.drive.Drive`` does, without its steps."""

    def __init__(self, drive: DriveParameters, chassis: ChassisParameters, limits: MotionLimits) -> None:
        self._max_rim_speed_m_s, self._limits = drive.max_rim_speed_m_s, limits
        self._kinematics, self._names = Kinematics(chassis), [wheel.name for wheel in chassis.wheels]
        self._last: tuple[Twist2D, Allowed[Twist2D]] | None = None

    def relimit(self, limits: MotionLimits) -> None:
        """The robot obeys other limits from now on."""
        self._limits, self._last = limits, None

    def of_twist(self, command: Twist2D) -> Allowed[Twist2D]:
        """First what the wheels reach, with its curvature, then the limits of each axis. The last one is remembered."""
        if self._last is not None and self._last[0] == command:
            return self._last[1]
        reachable = self._kinematics.saturate(command, self._max_rim_speed_m_s)
        shares = self._shares(self._kinematics.rim_speeds_m_s(command), command)
        allowed = Allowed(within_speeds(self._limits, reachable), _tightest(shares))
        self._last = command, allowed
        return allowed

    def of_wheels(self, command: WheelVelocities) -> Allowed[Mapping[str, float]]:
        """Every wheel's speed in rad/s by its name: slowed together, to what the fastest and their motion may do."""
        wheels = zip(command.rad_s, self._kinematics.radii_m, strict=True)
        shares = self._shares([velocity * radius_m for velocity, radius_m in wheels], command.twist)
        allowed = command.slowed(min(shares.values())).rad_s
        return Allowed(dict(zip(self._names, allowed, strict=True)), _tightest(shares))

    def _shares(self, rims_m_s: Sequence[float], twist: Twist2D) -> dict[str, float]:
        """How much of a motion each limit allows, 0 to 1, by its key in the configuration."""
        return {
            "drive.max_rim_speed_m_s": share_of_rims(self._max_rim_speed_m_s, rims_m_s),
            "limits.linear": self._limits.linear.axis.share_of(twist.linear_m_s),
            "limits.angular": self._limits.angular.axis.share_of(twist.angular_rad_s),
        }


def _tightest(shares: dict[str, float]) -> str | None:
    limit = min(shares, key=shares.__getitem__)
    return limit if shares[limit] < 1.0 else None
