"""Follows a course of straight lines and turns in place: pure functions from the robot's pose to a velocity.

Poses are in the course's own frame, whose origin is where the robot started: ``course_from_base``.
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

from pydantic import Field

from chefbotd.cli.drive.turning import TurnParameters
from chefbotd.core.geometry import Pose2D, Twist2D, wrap_angle
from chefbotd.core.parameters import Parameters


class CourseParameters(Parameters):
    """Speeds, deceleration and tolerances of a course.

    A side fails when the robot comes no nearer for ``patience_s``. Corrections turn at ``turn_rad_s`` at most.
    """

    cruise_m_s: float = Field(0.3, gt=0)
    creep_m_s: float = Field(0.03, gt=0)
    deceleration_m_s2: float = Field(0.25, gt=0)
    turn_rad_s: float = Field(1.2, gt=0)
    heading_gain_per_s: float = Field(2.0, ge=0)
    cross_track_gain_rad_per_m: float = Field(2.0, ge=0)
    position_tolerance_m: float = Field(0.005, gt=0)
    turn: TurnParameters = TurnParameters()
    patience_s: float = Field(10.0, gt=0)
    time_limit_s: float = Field(600.0, gt=0)


@dataclass(frozen=True, slots=True)
class GoTo:
    """Drive along the target's heading until level with the target."""

    target: Pose2D


@dataclass(frozen=True, slots=True)
class TurnTo:
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


def steer(parameters: CourseParameters, leg: GoTo, course_from_base: Pose2D) -> Twist2D | None:
    """The velocity for this side; None when it is done."""
    target_from_base = leg.target.inverse().compose(course_from_base)
    remaining_m = -target_from_base.x_m
    if remaining_m <= parameters.position_tolerance_m:
        return None
    linear = slowing(remaining_m, parameters.cruise_m_s, parameters.creep_m_s, parameters.deceleration_m_s2)
    wanted_rad = -parameters.cross_track_gain_rad_per_m * target_from_base.y_m
    angular = parameters.heading_gain_per_s * wrap_angle(wanted_rad - target_from_base.heading_rad)
    return Twist2D(linear, math.copysign(min(abs(angular), parameters.turn_rad_s), angular))


def slowing(distance: float, cruise: float, creep: float, deceleration: float) -> float:
    """The speed from which ``deceleration`` stops within ``distance``, between ``creep`` and ``cruise``."""
    return max(min(math.sqrt(2 * deceleration * distance), cruise), creep)


@dataclass(frozen=True, slots=True)
class Deviation:
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
