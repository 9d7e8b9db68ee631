"""Shared parts of the follower's steps: the robot's limits, their inputs and results, and limited twists."""

import math
from dataclasses import dataclass
from enum import StrEnum

from pydantic import Field

from chefbotd.core.geometry import STANDING, Pose2D, Twist2D
from chefbotd.core.parameters import Parameters
from chefbotd.navigation.arcs import ArcParameters, stopping_speed, turn
from chefbotd.navigation.grid_frame import Floats
from chefbotd.navigation.outline import OutlineParameters
from chefbotd.navigation.surroundings import Surroundings

TURN_BRAKING = 0.85
"""A turn is slowed down by this share of what the robot can."""

BRAKING = 1.5
"""Speed falls by this share of the deceleration that is planned with."""


class FollowerParameters(Parameters):
    """The robot's limits while it follows a path, and when it is there."""

    max_speed_m_s: float = Field(default=0.30, gt=0, le=10)
    max_reverse_m_s: float = Field(default=0.12, gt=0, le=10)
    max_turn_rad_s: float = Field(default=1.2, gt=0, le=10)
    acceleration_m_s2: float = Field(default=0.5, gt=0, le=10)
    deceleration_m_s2: float = Field(default=0.5, gt=0, le=10)
    turn_acceleration_rad_s2: float = Field(default=1.8, gt=0, le=20)
    delay_s: float = Field(default=0.15, ge=0, le=1)
    """From a pose to the motion that it leads to."""
    least_speed_m_s: float = Field(default=0.03, gt=0, le=1)
    """Slower than this wheels may not turn at all."""
    least_turn_rad_s: float = Field(default=0.15, gt=0, le=3)
    lookahead_s: float = Field(default=1.0, gt=0, le=10)
    least_lookahead_m: float = Field(default=0.18, gt=0, le=5)
    most_lookahead_m: float = Field(default=0.5, gt=0, le=5)
    most_curvature_per_m: float = Field(default=6.0, gt=0, le=100)
    curve_turn_rad_s: float = Field(default=0.9, gt=0, le=10)
    """Curves are driven so fast that the robot turns no faster than this."""
    turn_on_the_spot_rad: float = Field(default=0.9, gt=0, le=3.2)
    """Where the path leads off by more than this, the robot turns before it drives."""
    aligned_rad: float = Field(default=0.25, gt=0, le=3.2)
    approach_m: float = Field(default=0.25, gt=0, le=5)
    """From here on it drives straight to the goal."""
    position_m: float = Field(default=0.02, gt=0, le=1)
    """It is there when it is so near: the pose of the goal is promised within 0.03 m and 3 degrees."""
    heading_rad: float = Field(default=0.026, gt=0, le=3.2)
    arcs: ArcParameters = ArcParameters()


class Phase(StrEnum):
    """What the robot does on its way."""

    TURNING = "turning"
    TRACKING = "tracking"
    APPROACHING = "approaching"
    FINAL_TURN = "final_turn"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class FollowState:
    """Where on the path the robot is (the index of a point), and what it does."""

    index: int = 0
    phase: Phase = Phase.TRACKING


@dataclass(frozen=True, slots=True)
class Followed:
    """The next state, the twist to ask for, and whether something is in the way of it."""

    state: FollowState
    twist: Twist2D
    is_blocked: bool = False


@dataclass(frozen=True, slots=True)
class Track:
    """What is followed, in the grid's frame; ``speed_limit_m_s`` is what zones allow here."""

    points_m: Floats
    end_heading_rad: float | None
    speed_limit_m_s: float = math.inf


def predicted(params: FollowerParameters, pose: Pose2D, twist: Twist2D) -> Pose2D:
    """Where the robot will be when what is asked for now takes effect."""
    turned = twist.angular_rad_s * params.delay_s
    moved = twist.linear_m_s * params.delay_s
    return pose.compose(Pose2D(moved * math.cos(turned / 2), moved * math.sin(turned / 2), turned))


def turn_by(
    params: FollowerParameters,
    outline: OutlineParameters,
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
        free_rad = turn(params.arcs, outline, near, angle_rad).free
        if free_rad >= abs(angle_rad) - 1e-6:
            speed = stopping_speed(
                abs(angle_rad), params.turn_acceleration_rad_s2 * TURN_BRAKING, params.delay_s
            )
            speed = min(max(speed, params.least_turn_rad_s), params.max_turn_rad_s)
            wish = Twist2D(0.0, math.copysign(speed, angle_rad))
            return Followed(state, slewed(params, last, wish, dt_s))
    return Followed(state, slewed(params, last, STANDING, dt_s), is_blocked=True)


def on_arc(
    params: FollowerParameters, last: Twist2D, speed_m_s: float, curvature: float, dt_s: float
) -> Twist2D:
    """A twist on an arc; ``curvature`` times the speed is the turning, also in reverse."""
    linear = slewed(params, last, Twist2D(speed_m_s, 0.0), dt_s).linear_m_s
    most = params.max_turn_rad_s
    wish = Twist2D(linear, min(max(linear * curvature, -most), most))
    return slewed(params, last, wish, dt_s)


def slewed(params: FollowerParameters, last: Twist2D, wish: Twist2D, dt_s: float) -> Twist2D:
    """As much of a change as the accelerations allow."""
    braking = abs(wish.linear_m_s) < abs(last.linear_m_s)
    rate = params.deceleration_m_s2 * BRAKING if braking else params.acceleration_m_s2
    linear = last.linear_m_s + min(max(wish.linear_m_s - last.linear_m_s, -rate * dt_s), rate * dt_s)
    change = params.turn_acceleration_rad_s2 * dt_s
    angular = last.angular_rad_s + min(max(wish.angular_rad_s - last.angular_rad_s, -change), change)
    return Twist2D(linear, angular)
