"""The limits for wheels that each have their own target speed.

Together their speeds make a twist, whose speed, acceleration and jerk are limited like any other; a stop brakes the
robot as hard as any other. What is left is how the wheels of a side differ from their mean, which moves nothing. On
the way to other speeds all rims change in step, none faster than the linear acceleration limits. On the way to a stop
the differences end on their own, at that rate.
"""

from collections.abc import Sequence

from chefbotd.core.geometry import Twist2D
from chefbotd.motion.limits import NO_GAP, MotionLimits
from chefbotd.motion.ramp import AxisLimits

Rims = tuple[float, ...]


def share_of(
    limits: MotionLimits, max_rim_speed_m_s: float, speeds_m_s: Sequence[float], twist: Twist2D
) -> float:
    """The share of these rim speeds, which make this twist, that the limits allow (0 to 1): their ratios are kept."""
    return min(
        share_of_rims(max_rim_speed_m_s, speeds_m_s),
        limits.linear.axis.share_of(twist.linear_m_s),
        limits.angular.axis.share_of(twist.angular_rad_s),
    )


def share_of_rims(max_rim_speed_m_s: float, speeds_m_s: Sequence[float]) -> float:
    """The share of these rim speeds that the wheels reach, 0 to 1."""
    fastest_m_s = max(map(abs, speeds_m_s))
    return 1.0 if fastest_m_s <= max_rim_speed_m_s else max_rim_speed_m_s / fastest_m_s


def pace_s(axis: AxisLimits, speeds_m_s: Rims, aims_m_s: Rims) -> float:
    """The time that the rim with the longest way takes to its target at the axis' accelerations."""
    gaps = [(speed, aim - speed) for speed, aim in zip(speeds_m_s, aims_m_s, strict=True)]
    return max(abs(gap) / axis.rate(speed, gap) for speed, gap in gaps)


def progress(before: Twist2D, after: Twist2D, aim: Twist2D) -> float:
    """The share of the way to the target that lies between two twists, 0 to 1; 1 where there was no way to go."""
    gaps = [
        (abs(aim.linear_m_s - was.linear_m_s), abs(aim.angular_rad_s - was.angular_rad_s))
        for was in (before, after)
    ]
    was, left = max(zip(*gaps, strict=True))
    return 1.0 if was < NO_GAP else min(1.0, max(0.0, 1.0 - left / was))


def approach(speeds_m_s: Rims, aims_m_s: Rims, share: float) -> Rims:
    """The speeds after this share of the way to the targets."""
    if share >= 1.0:
        return aims_m_s
    return tuple([now + share * (aim - now) for now, aim in zip(speeds_m_s, aims_m_s, strict=True)])


def minus(some_m_s: Rims, others_m_s: Rims) -> Rims:
    """By how much each rim is faster than the other."""
    return tuple([one - other for one, other in zip(some_m_s, others_m_s, strict=True)])


def plus(some_m_s: Rims, others_m_s: Rims) -> Rims:
    """Each rim's two speeds together."""
    return tuple([one + other for one, other in zip(some_m_s, others_m_s, strict=True)])


def alike(some_m_s: Rims, others_m_s: Rims) -> bool:
    """Whether these rim speeds are the same, as far as numbers are."""
    return all(abs(one - other) < NO_GAP for one, other in zip(some_m_s, others_m_s, strict=True))
