"""Shared parts of the follower's steps: the robot's limits, their inputs and results, and limited twists."""

import math
from enum import StrEnum
from typing import Final

from chefbotd.core.geometry import STANDING, Pose2D, Twist2D
from chefbotd.core.record import Record
from chefbotd.navigation.arcs import stopping_speed, turn
from chefbotd.navigation.grid_frame import Floats
from chefbotd.navigation.outline import Footprint
from chefbotd.navigation.surroundings import Surroundings

TURN_BRAKING = 0.85
"""A turn is slowed down by this share of what the robot can."""

BRAKING = 1.5
"""Speed falls by this share of the deceleration that is planned with."""


LOOKAHEAD_S: Final = 1.0
LEAST_LOOKAHEAD_M, MOST_LOOKAHEAD_M = 0.18, 0.5
"""The robot steers for where the path is so far ahead, in seconds of its speed and within these bounds."""

MOST_CURVATURE_PER_M: Final = 6.0
TURN_ON_THE_SPOT_RAD: Final = 0.9
"""Where the path leads off by more than this, the robot turns before it drives,"""

ALIGNED_RAD: Final = 0.25
"""until it leads off by no more than this."""

APPROACH_M: Final = 0.25
"""From here on it drives straight to the goal."""


class FollowerLimits(Record, frozen=True):
    """The robot's limits while it follows a path, and when it is there; a board that obeys late has others.

    ``delay_s`` is from a pose to the motion that it leads to. Slower than the least speeds wheels may not turn at all.
    Curves are driven so fast that the robot turns no faster than ``curve_turn_rad_s``. It is there within ``position_m``
    and ``heading_rad``: 0.03 m and 3 degrees are promised.
    """

    max_speed_m_s: float = 0.30
    max_reverse_m_s: float = 0.12
    max_turn_rad_s: float = 1.2
    acceleration_m_s2: float = 0.5
    deceleration_m_s2: float = 0.5
    turn_acceleration_rad_s2: float = 1.8
    delay_s: float = 0.15
    least_speed_m_s: float = 0.03
    least_turn_rad_s: float = 0.15
    curve_turn_rad_s: float = 0.9
    position_m: float = 0.02
    heading_rad: float = 0.026


class Phase(StrEnum):
    """What the robot does on its way."""

    TURNING = "turning"
    TRACKING = "tracking"
    APPROACHING = "approaching"
    FINAL_TURN = "final_turn"
    DONE = "done"


class FollowState(Record, frozen=True):
    """Where on the path the robot is (the index of a point), and what it does.

    ``asked_m`` is how far it was asked to drive since it came to ``from_m`` on its approach to the goal; ``held`` is how
    often it stayed there all the same.
    """

    index: int = 0
    phase: Phase = Phase.TRACKING
    held: int = 0
    from_m: tuple[float, float] | None = None
    asked_m: float = 0.0


class Followed(Record, frozen=True):
    """The next state, the twist to ask for, and whether something is in the way of it.

    ``turns_rad`` is the turn on the spot that is blocked; 0: it is driving ahead.
    """

    state: FollowState
    twist: Twist2D
    is_blocked: bool = False
    turns_rad: float = 0.0


class Track(Record, frozen=True):
    """What is followed, in the grid's frame; ``speed_limit_m_s`` is what zones allow here."""

    points_m: Floats
    end_heading_rad: float | None
    speed_limit_m_s: float = math.inf


def predicted(params: FollowerLimits, pose: Pose2D, twist: Twist2D) -> Pose2D:
    """Where the robot will be when what is asked for now takes effect."""
    turned = twist.angular_rad_s * params.delay_s
    moved = twist.linear_m_s * params.delay_s
    return pose.compose(Pose2D(moved * math.cos(turned / 2), moved * math.sin(turned / 2), turned))


def turn_by(
    params: FollowerLimits,
    outline: Footprint,
    state: FollowState,
    error_rad: float,
    near: Surroundings,
    last: Twist2D,
    dt_s: float,
) -> Followed:
    """Turn on the spot where the outline has room for it, the other way round where only that has."""
    if abs(last.linear_m_s) > 0.02:  # first stand
        return Followed(state, slewed(params, last, STANDING, dt_s))
    ways = [error_rad, error_rad - math.copysign(math.tau, error_rad)]
    for angle_rad in ways:
        free_rad = turn(outline, near, angle_rad).free
        if free_rad >= abs(angle_rad) - 1e-6:
            speed = stopping_speed(
                abs(angle_rad), params.turn_acceleration_rad_s2 * TURN_BRAKING, params.delay_s
            )
            speed = min(max(speed, params.least_turn_rad_s), params.max_turn_rad_s)
            wish = Twist2D(0.0, math.copysign(speed, angle_rad))
            return Followed(state, slewed(params, last, wish, dt_s))
    return Followed(state, slewed(params, last, STANDING, dt_s), is_blocked=True, turns_rad=error_rad)


def on_arc(params: FollowerLimits, last: Twist2D, speed_m_s: float, curvature: float, dt_s: float) -> Twist2D:
    """A twist on an arc; ``curvature`` times the speed is the turning, also in reverse."""
    linear = slewed(params, last, Twist2D(speed_m_s, 0.0), dt_s).linear_m_s
    most = params.max_turn_rad_s
    wish = Twist2D(linear, min(max(linear * curvature, -most), most))
    return slewed(params, last, wish, dt_s)


def slewed(params: FollowerLimits, last: Twist2D, wish: Twist2D, dt_s: float) -> Twist2D:
    """As much of a change as the accelerations allow."""
    braking = abs(wish.linear_m_s) < abs(last.linear_m_s)
    rate = params.deceleration_m_s2 * BRAKING if braking else params.acceleration_m_s2
    linear = last.linear_m_s + min(max(wish.linear_m_s - last.linear_m_s, -rate * dt_s), rate * dt_s)
    change = params.turn_acceleration_rad_s2 * dt_s
    angular = last.angular_rad_s + min(max(wish.angular_rad_s - last.angular_rad_s, -change), change)
    return Twist2D(linear, angular)
