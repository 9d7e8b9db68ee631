"""Limits of the robot as a whole: speed, acceleration and jerk of its twist, forward and in reverse.

A change of direction first brakes to zero and then accelerates, each with its own limit. A stop that must be immediate
does not come through here: it resets the limiter to ``AT_REST``.
"""

import math
from functools import cached_property
from typing import Annotated

from pydantic import Field

from chefbotd.core.geometry import STANDING, Twist2D
from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.motion.ramp import AxisLimits, advance

Speed = Annotated[float, Field(ge=0, le=100)]
Rate = Annotated[float, Field(gt=0, le=1e4)]
Jerk = Annotated[float, Field(gt=0, le=1e6)]


class LinearLimits(Parameters):
    """Limits along the robot's x axis.

    ``max_reverse_m_s`` may be 0: the robot does not reverse. Defaults: reverse is as forward, braking as accelerating,
    jerk unlimited.
    """

    max_forward_m_s: float = Field(gt=0, le=100)
    """The fastest that the robot drives forward."""
    max_reverse_m_s: Speed | None = None
    """The fastest that it drives backward; 0: it does not reverse. Left out, as fast as forward."""
    acceleration_m_s2: Rate
    """How fast it gains speed forward."""
    deceleration_m_s2: Rate | None = None
    """How fast it brakes from driving forward; left out, as it accelerates."""
    reverse_acceleration_m_s2: Rate | None = None
    """How fast it gains speed backward; left out, as forward."""
    reverse_deceleration_m_s2: Rate | None = None
    """How fast it brakes from driving backward; left out, as from driving forward."""
    jerk_m_s3: Jerk | None = None
    """How fast its acceleration changes; left out, at once."""

    @cached_property
    def axis(self) -> AxisLimits:
        """The limits with everything that was left out filled in."""
        deceleration = _or(self.deceleration_m_s2, self.acceleration_m_s2)
        return AxisLimits(
            max_forward=self.max_forward_m_s,
            max_reverse=_or(self.max_reverse_m_s, self.max_forward_m_s),
            acceleration=self.acceleration_m_s2,
            deceleration=deceleration,
            reverse_acceleration=_or(self.reverse_acceleration_m_s2, self.acceleration_m_s2),
            reverse_deceleration=_or(self.reverse_deceleration_m_s2, deceleration),
            jerk=_or(self.jerk_m_s3, math.inf),
        )


class AngularLimits(Parameters):
    """Limits of turning, left being positive.

    Defaults: right is as left, braking as accelerating, jerk unlimited.
    """

    max_left_rad_s: Speed
    """The fastest that the robot turns to the left."""
    max_right_rad_s: Speed | None = None
    """The fastest that it turns to the right; left out, as to the left."""
    acceleration_rad_s2: Rate
    """How fast its turn to the left grows."""
    deceleration_rad_s2: Rate | None = None
    """How fast its turn to the left is braked; left out, as it grows."""
    right_acceleration_rad_s2: Rate | None = None
    """How fast its turn to the right grows; left out, as to the left."""
    right_deceleration_rad_s2: Rate | None = None
    """How fast its turn to the right is braked; left out, as to the left."""
    jerk_rad_s3: Jerk | None = None
    """How fast its angular acceleration changes; left out, at once."""

    @cached_property
    def axis(self) -> AxisLimits:
        """The limits with everything that was left out filled in."""
        deceleration = _or(self.deceleration_rad_s2, self.acceleration_rad_s2)
        return AxisLimits(
            max_forward=self.max_left_rad_s,
            max_reverse=_or(self.max_right_rad_s, self.max_left_rad_s),
            acceleration=self.acceleration_rad_s2,
            deceleration=deceleration,
            reverse_acceleration=_or(self.right_acceleration_rad_s2, self.acceleration_rad_s2),
            reverse_deceleration=_or(self.right_deceleration_rad_s2, deceleration),
            jerk=_or(self.jerk_rad_s3, math.inf),
        )


class MotionLimits(Parameters):
    """Both axes; with ``keep_curvature`` what slows one slows the other, so that the path keeps its shape."""

    linear: LinearLimits
    angular: AngularLimits
    keep_curvature: bool = True


class LimiterState(Record, frozen=True):
    """The twist now allowed, and how fast it is changing: the same fields, per second."""

    twist: Twist2D = STANDING
    acceleration: Twist2D = STANDING


AT_REST = LimiterState()

NO_GAP = 1e-9
"""An axis as near to its target as this (m/s or rad/s) shapes no path any more, so it need not keep any pace."""


def limit(
    params: MotionLimits, state: LimiterState, target: Twist2D, dt_s: float, pace_s: float = 0.0
) -> LimiterState:
    """Go towards a finite target for ``dt_s``, as far as the limits allow; no time (<= 0), no change.

    Standing still has no curvature to keep: to a stop, each axis brakes as hard as it may. Where the curvature is kept,
    what else has to arrive with the twist may need ``pace_s`` seconds for it.
    """
    if dt_s <= 0:
        return state
    linear, angular = params.linear.axis, params.angular.axis
    aim = within_speeds(params, target)
    if state.twist == aim and state.acceleration == STANDING:
        return state
    if params.keep_curvature and aim != STANDING:
        linear, angular = _in_step(linear, angular, state, aim, pace_s)
    now, change = state.twist, state.acceleration
    linear_m_s, linear_m_s2 = advance(linear, now.linear_m_s, change.linear_m_s, aim.linear_m_s, dt_s)
    angular_rad_s, angular_rad_s2 = advance(
        angular, now.angular_rad_s, change.angular_rad_s, aim.angular_rad_s, dt_s
    )
    return LimiterState(Twist2D(linear_m_s, angular_rad_s), Twist2D(linear_m_s2, angular_rad_s2))


def within_speeds(params: MotionLimits, target: Twist2D) -> Twist2D:
    """As much of a twist as the speed limits allow."""
    linear_share = params.linear.axis.share_of(target.linear_m_s)
    angular_share = params.angular.axis.share_of(target.angular_rad_s)
    if linear_share == angular_share == 1.0:
        return target
    if params.keep_curvature:
        linear_share = angular_share = min(linear_share, angular_share)
    return Twist2D(target.linear_m_s * linear_share, target.angular_rad_s * angular_share)


def _in_step(
    linear: AxisLimits, angular: AxisLimits, state: LimiterState, aim: Twist2D, others_pace_s: float
) -> tuple[AxisLimits, AxisLimits]:
    """Limits under which both axes arrive together: from rest, or faster on an arc, the curvature is kept.

    Each axis would need so many seconds at its full acceleration (and so many squared at its full jerk); the
    one that needs more sets the pace.
    """
    linear_gap = aim.linear_m_s - state.twist.linear_m_s
    angular_gap = aim.angular_rad_s - state.twist.angular_rad_s
    pace_s = max(
        others_pace_s,
        abs(linear_gap) / linear.rate(state.twist.linear_m_s, linear_gap),
        abs(angular_gap) / angular.rate(state.twist.angular_rad_s, angular_gap),
    )
    pace_s2 = max(abs(linear_gap) / linear.jerk, abs(angular_gap) / angular.jerk)
    return (
        _slow_to_pace(
            linear, state.twist.linear_m_s, state.acceleration.linear_m_s, linear_gap, pace_s, pace_s2
        ),
        _slow_to_pace(
            angular, state.twist.angular_rad_s, state.acceleration.angular_rad_s, angular_gap, pace_s, pace_s2
        ),
    )


def _slow_to_pace(
    axis: AxisLimits, speed: float, acceleration: float, gap: float, pace_s: float, pace_s2: float
) -> AxisLimits:
    """The axis slowed to the pace, but not below what its present acceleration needs to end at the target."""
    if abs(gap) < NO_GAP:
        return axis
    share = abs(gap) / axis.rate(speed, gap) / pace_s
    if pace_s2 == 0 or acceleration * gap < 0:
        return axis.slowed(share, axis.jerk)
    landing = acceleration * acceleration / (2 * abs(gap))
    return axis.slowed(share, min(axis.jerk, max(abs(gap) / pace_s2, landing)))


def _or(value: float | None, fallback: float) -> float:
    return fallback if value is None else value
