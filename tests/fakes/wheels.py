"""What wheels must do for a robot to move in some way, worked out from its rims: an oracle for tests."""

from collections.abc import Sequence

from chefbotd.core.geometry import Twist2D
from chefbotd.motion.kinematics import Kinematics


def wheel_speeds_rad_s(kinematics: Kinematics, twist: Twist2D) -> tuple[float, ...]:
    """How fast each wheel must turn for the robot to move so."""
    return turned(kinematics, kinematics.rim_speeds_m_s(twist))


def turned(kinematics: Kinematics, rims_m: Sequence[float]) -> tuple[float, ...]:
    """The angles of wheels whose rims go so far, or their speeds in rad/s where rims go so fast."""
    return tuple(rim_m / radius_m for rim_m, radius_m in zip(rims_m, kinematics.radii_m, strict=True))
