"""Follows a course of straight lines and turns in place: pure functions from the robot's pose to a velocity.

Poses are in the course's own frame, whose origin is where the robot started: ``course_from_base``.
"""

import math
from typing import TypeAlias

from chefbotd.core.geometry import Pose2D, Twist2D, wrap_angle
from chefbotd.core.record import Record

CRUISE_M_S, CREEP_M_S, DECELERATION_M_S2 = 0.3, 0.03, 0.25
"""How fast a side is driven, how slowly its end is approached, and how the robot slows down."""

TURN_RAD_S = 1.2
"""Corrections turn no faster."""

HEADING_GAIN_PER_S, CROSS_TRACK_GAIN_RAD_PER_M = 2.0, 2.0
POSITION_TOLERANCE_M = 0.005


class GoTo(Record, frozen=True):
    """Drive along the target's heading until level with the target."""

    target: Pose2D


class TurnTo(Record, frozen=True):
    """Turn in place, the shorter way, to the target's heading."""

    target: Pose2D


Leg: TypeAlias = GoTo | TurnTo


def square(side_m: float) -> tuple[Leg, ...]:
    """Four sides and four left turns, ending where it began."""
    legs: list[Leg] = []
    here = Pose2D()
    for _ in range(4):
        here = here.compose(Pose2D(x_m=side_m))
        legs.append(GoTo(here))
        here = here.compose(Pose2D(heading_rad=math.pi / 2))
        legs.append(TurnTo(here))
    return tuple(legs)


def remaining(leg: Leg, course_from_base: Pose2D) -> float:
    """The rest of this leg: metres along a side (negative beyond its end), or radians of a turn."""
    if isinstance(leg, GoTo):
        return -leg.target.inverse().compose(course_from_base).x_m
    return abs(remaining_rad(leg, course_from_base))


def remaining_rad(leg: TurnTo, course_from_base: Pose2D) -> float:
    """The angle left to turn, the shorter way, in radians: CCW positive."""
    return wrap_angle(leg.target.heading_rad - course_from_base.heading_rad)


def steer(leg: GoTo, course_from_base: Pose2D) -> Twist2D | None:
    """The velocity for this side; None when it is done."""
    target_from_base = leg.target.inverse().compose(course_from_base)
    remaining_m = -target_from_base.x_m
    if remaining_m <= POSITION_TOLERANCE_M:
        return None
    linear = slowing(remaining_m, CRUISE_M_S, CREEP_M_S, DECELERATION_M_S2)
    wanted_rad = -CROSS_TRACK_GAIN_RAD_PER_M * target_from_base.y_m
    angular = HEADING_GAIN_PER_S * wrap_angle(wanted_rad - target_from_base.heading_rad)
    return Twist2D(linear, math.copysign(min(abs(angular), TURN_RAD_S), angular))


def slowing(distance: float, cruise: float, creep: float, deceleration: float) -> float:
    """The speed from which ``deceleration`` stops within ``distance``, between ``creep`` and ``cruise``."""
    return max(min(math.sqrt(2 * deceleration * distance), cruise), creep)


class Deviation(Record, frozen=True):
    """The difference of two poses: distance, and absolute difference of heading."""

    distance_m: float
    heading_rad: float

    def __str__(self) -> str:
        return f"{1000 * self.distance_m:.1f} mm and {math.degrees(self.heading_rad):.2f}°"

    def within(self, distance_m: float, heading_rad: float) -> bool:
        """Whether both differences are at most this large."""
        return self.distance_m <= distance_m and self.heading_rad <= heading_rad


def deviation(one: Pose2D, other: Pose2D) -> Deviation:
    """Distance and absolute difference of heading between two poses of one frame."""
    return Deviation(
        math.hypot(one.x_m - other.x_m, one.y_m - other.y_m),
        abs(wrap_angle(one.heading_rad - other.heading_rad)),
    )
