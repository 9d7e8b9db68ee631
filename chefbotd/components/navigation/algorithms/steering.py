"""Shared parts of the follower's steps: the robot's limits, their inputs and results, and limited twists."""

import math
from enum import StrEnum
from typing import Final

from chefbotd.components.navigation.algorithms.arcs import check_turn, stopping_speed
from chefbotd.components.navigation.algorithms.grid import Floats
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D
from chefbotd.core.record import Record

TURN_BRAKING = 0.85
"""A turn is braked with this share of the turn acceleration."""

BRAKING = 1.5
"""Braking uses this share of the deceleration that is planned with."""


LOOKAHEAD_S: Final = 1.0
LEAST_LOOKAHEAD_M, MOST_LOOKAHEAD_M = 0.18, 0.5
"""The robot steers for where the path is so far ahead, in seconds of its speed and within these bounds,"""

TIGHT_SHARE: Final = 0.6
"""and in a tight passage for this share of it: it has a centimetre to either side, and must be in line at its mouth."""

MOST_CURVATURE_PER_M: Final = 6.0
TURN_ON_THE_SPOT_RAD: Final = 0.9
"""Where the path leads off by more than this, the robot turns before it drives,"""

ALIGNED_RAD: Final = 0.25
"""until it leads off by no more than this."""

APPROACH_M: Final = 0.25
"""From here on it drives straight to the goal."""


class FollowerLimits(Record, frozen=True):
    """The robot's limits while it follows a path, and its tolerances at the goal; a board that obeys late has others.

    ``delay_s`` is the time from a pose to the motion that it leads to. Below the least speeds wheels may not turn.
    In curves the robot turns no faster than ``curve_turn_rad_s``. ``position_m`` and ``heading_rad`` are tighter than
    the 0.03 m and 3 degrees that are promised.
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
    """What the robot does along its path."""

    TURNING = "turning"
    TRACKING = "tracking"
    APPROACHING = "approaching"
    FINAL_TURN = "final_turn"
    DONE = "done"


class FollowState(Record, frozen=True):
    """Where on the path the robot is (the index of a point), and what it does.

    On the approach to the goal: ``asked_m`` is how far it was commanded to drive since it came to ``from_m``;
    ``held`` is how often it did not move all the same.
    """

    index: int = 0
    phase: Phase = Phase.TRACKING
    held: int = 0
    from_m: tuple[float, float] | None = None
    asked_m: float = 0.0


class Followed(Record, frozen=True):
    """The next state, the twist to command, and whether an obstacle blocks the motion.

    ``turns_rad`` is the turn on the spot that is blocked; 0: driving ahead is.
    """

    state: FollowState
    twist: Twist2D
    is_blocked: bool = False
    turns_rad: float = 0.0


class Track(Record, frozen=True):
    """The path to follow, in the grid's frame; ``speed_limit_m_s`` is what is allowed here.

    ``is_tight`` says that it leads along the measured middle of a tight passage.
    """

    points_m: Floats
    end_heading_rad: float | None
    speed_limit_m_s: float = math.inf
    is_tight: bool = False


class Control(Record, frozen=True):
    """What a step of the follower is made with: the robot, what is around it, and the twist that was commanded last.

    The robot is (or will be, see ``predict_pose``) at ``surroundings.grid_from_base``.
    """

    limits: FollowerLimits
    outline: Footprint
    surroundings: Surroundings
    last: Twist2D
    dt_s: float

    @property
    def standing(self) -> Twist2D:
        """As near to standing as the deceleration allows."""
        return limit_change(self.limits, self.last, STANDING, self.dt_s)

    def in_base(self, point: Floats) -> Pose2D:
        """A point (x, y) of the grid's frame in the robot's frame."""
        return self.surroundings.grid_from_base.inverse().compose(Pose2D(float(point[0]), float(point[1])))


def predict_pose(params: FollowerLimits, pose: Pose2D, twist: Twist2D) -> Pose2D:
    """Where the robot will be when a command that is given now takes effect."""
    turned = twist.angular_rad_s * params.delay_s
    moved = twist.linear_m_s * params.delay_s
    return pose.compose(Pose2D(moved * math.cos(turned / 2), moved * math.sin(turned / 2), turned))


def turn_by(control: Control, state: FollowState, error_rad: float) -> Followed:
    """Turn on the spot if the outline has room for it; in the other direction if only that has room."""
    limits, last = control.limits, control.last
    if abs(last.linear_m_s) > 0.02:  # first stand
        return Followed(state, control.standing)
    for angle_rad in (error_rad, error_rad - math.copysign(math.tau, error_rad)):
        free_rad = check_turn(control.outline, control.surroundings, angle_rad).free
        if free_rad >= abs(angle_rad) - 1e-6:
            braking_rad_s2 = limits.turn_acceleration_rad_s2 * TURN_BRAKING
            speed = stopping_speed(abs(angle_rad), braking_rad_s2, limits.delay_s)
            speed = min(max(speed, limits.least_turn_rad_s), limits.max_turn_rad_s)
            wish = Twist2D(0.0, math.copysign(speed, angle_rad))
            return Followed(state, limit_change(limits, last, wish, control.dt_s))
    return Followed(state, control.standing, is_blocked=True, turns_rad=error_rad)


def on_arc(control: Control, speed_m_s: float, curvature: float) -> Twist2D:
    """A twist on an arc; ``curvature`` times the speed is the turning, also in reverse."""
    limits, last, dt_s = control.limits, control.last, control.dt_s
    linear = limit_change(limits, last, Twist2D(speed_m_s, 0.0), dt_s).linear_m_s
    most = limits.max_turn_rad_s
    return limit_change(limits, last, Twist2D(linear, min(max(linear * curvature, -most), most)), dt_s)


def limit_change(params: FollowerLimits, last: Twist2D, wish: Twist2D, dt_s: float) -> Twist2D:
    """As much of a change as the accelerations allow."""
    braking = abs(wish.linear_m_s) < abs(last.linear_m_s)
    rate = params.deceleration_m_s2 * BRAKING if braking else params.acceleration_m_s2
    linear = last.linear_m_s + min(max(wish.linear_m_s - last.linear_m_s, -rate * dt_s), rate * dt_s)
    change = params.turn_acceleration_rad_s2 * dt_s
    angular = last.angular_rad_s + min(max(wish.angular_rad_s - last.angular_rad_s, -change), change)
    return Twist2D(linear, angular)
