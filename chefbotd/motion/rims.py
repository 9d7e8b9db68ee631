"""Wheels that are each asked for a speed of their own: every rim on a ramp to it, within the robot's limits.

The robot's speed limits hold for what the wheels come to together; the linear acceleration limits hold for every rim.
"""

from collections.abc import Sequence

from chefbotd.core.geometry import Twist2D
from chefbotd.motion.limits import NO_GAP, MotionLimits
from chefbotd.motion.ramp import AxisLimits, advance

Rims = tuple[float, ...]


def share_of(
    limits: MotionLimits, max_rim_speed_m_s: float, speeds_m_s: Sequence[float], twist: Twist2D
) -> float:
    """How much of these rim speeds, which make this twist, the robot may go (0 to 1): their ratios are kept."""
    return min(
        share_of_rims(max_rim_speed_m_s, speeds_m_s),
        limits.linear.axis.share_of(twist.linear_m_s),
        limits.angular.axis.share_of(twist.angular_rad_s),
    )


def share_of_rims(max_rim_speed_m_s: float, speeds_m_s: Sequence[float]) -> float:
    """How much of these rim speeds the wheels reach, 0 to 1."""
    fastest_m_s = max(map(abs, speeds_m_s))
    return 1.0 if fastest_m_s <= max_rim_speed_m_s else max_rim_speed_m_s / fastest_m_s


def ramp(
    axis: AxisLimits, speeds_m_s: Rims, accelerations_m_s2: Rims, aims_m_s: Rims, dt_s: float
) -> tuple[Rims, Rims]:
    """Speeds and accelerations after ``dt_s`` on the way to the aims; no time (<= 0), no change."""
    if dt_s <= 0:
        return speeds_m_s, accelerations_m_s2
    wheels = zip(speeds_m_s, accelerations_m_s2, aims_m_s, strict=True)
    steps = [advance(axis, *wheel, dt_s) for wheel in wheels]
    return tuple([speed for speed, _ in steps]), tuple([acceleration for _, acceleration in steps])


def alike(some_m_s: Rims, others_m_s: Rims) -> bool:
    """Whether these rim speeds are the same, as far as numbers are."""
    return all(abs(one - other) < NO_GAP for one, other in zip(some_m_s, others_m_s, strict=True))
