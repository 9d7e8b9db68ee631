"""From a path to a twist: regulated pure pursuit, then a straight approach and a turn to the goal's heading.

Macenski, Singh, Martin and Gines, "Regulated Pure Pursuit for Robot Path Tracking", Autonomous Robots 47, 2023: the
curvature leads to a point of the path ahead; curves, obstacles and the goal limit the speed. The arc is then checked
against what the lidar sees; where it is not free, the arcs about it are tried, as in the dynamic window (Fox, Burgard
and Thrun, 1997). Poses are predicted by the robot's delay, so that it does not oscillate at the end.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from pydantic import Field

from chefbotd.core.geometry import STANDING, Pose2D, Twist2D, wrap_angle
from chefbotd.core.parameters import Parameters
from chefbotd.navigation.arcs import (
    ArcParameters,
    Surroundings,
    Way,
    standing_only,
    stopping_speed,
    swept,
    turn,
    turned,
    way,
)
from chefbotd.navigation.grid_frame import Floats
from chefbotd.navigation.outline import OutlineParameters

TURN_BRAKING = 0.85
"""A turn is slowed down by this share of what the robot can."""

BRAKING, CLOSE_M = 1.5, 0.006
"""Speed falls by this share of the deceleration that is planned with; a goal so near ahead is not driven to any more."""

CLEAR_WORTH, SLIGHT_M = 4.0, 0.005
"""A metre less of room to what stands is as bad as so many beside the wanted arc; less than ``SLIGHT_M`` is nothing."""

TURN_GAIN_M = 0.015
"""Where an arc lacks so much more room than a turn on the spot and driving straight on, the robot turns."""

BACK_M = -0.4
"""So far backwards it looks."""


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


def follow(
    params: FollowerParameters,
    outline: OutlineParameters,
    state: FollowState,
    track: Track,
    near: Surroundings,
    last: Twist2D,
    dt_s: float,
) -> Followed:
    """One step; the robot is (or will be, see ``predicted``) at ``near.grid_from_base``, ``last`` was asked for last."""
    pose, points = near.grid_from_base, track.points_m
    index = _nearest(points, state.index, pose)
    end = points[-1]
    to_end_m = math.hypot(end[0] - pose.x_m, end[1] - pose.y_m)
    left_m = _length(points[index:]) if len(points) - index < 40 else math.inf
    state = replace(state, index=index)
    if state.phase is Phase.DONE:
        return Followed(state, slewed(params, last, STANDING, dt_s))
    if state.phase is not Phase.FINAL_TURN and _is_there(params, pose, end, to_end_m, last):
        state = replace(state, phase=Phase.FINAL_TURN)
    if state.phase is Phase.FINAL_TURN and to_end_m > params.approach_m:  # it made way for somebody
        state = replace(state, phase=Phase.TRACKING)
    if state.phase is Phase.FINAL_TURN:
        return _final_turn(params, outline, state, track, near, last, dt_s, to_end_m)
    if to_end_m < params.approach_m and left_m < 2 * params.approach_m:
        state = replace(state, phase=Phase.APPROACHING)
        return _approach(params, outline, state, end, near, last, dt_s)
    return _pursue(params, outline, state, track, near, last, dt_s)


def _is_there(params: FollowerParameters, pose: Pose2D, end: Floats, to_end_m: float, last: Twist2D) -> bool:
    """Whether it is near enough; while it drives, only where braking takes it no nearer."""
    if to_end_m >= params.position_m:
        return False
    ahead_m = (
        math.copysign(1.0, last.linear_m_s) * pose.inverse().compose(Pose2D(float(end[0]), float(end[1]))).x_m
    )
    braking_m = last.linear_m_s**2 / (2 * BRAKING * params.deceleration_m_s2)
    return abs(last.linear_m_s) < 1e-3 or ahead_m < braking_m + CLOSE_M


def _nearest(points: Floats, index: int, pose: Pose2D) -> int:
    """The nearest point from the last one on, not more than 1 m of path beyond it."""
    ahead = points[index : index + 20]
    return index + int(np.argmin(np.hypot(ahead[:, 0] - pose.x_m, ahead[:, 1] - pose.y_m)))


def _length(points: Floats) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def _carrot(points: Floats, index: int, pose: Pose2D, lookahead_m: float) -> tuple[float, float]:
    """In the robot's frame, where the path leaves the circle of the lookahead; its end if it does not."""
    ahead = points[index:]
    away = np.hypot(ahead[:, 0] - pose.x_m, ahead[:, 1] - pose.y_m)
    beyond = np.flatnonzero(away >= lookahead_m)
    x_m, y_m = ahead[int(beyond[0])] if len(beyond) else ahead[-1]
    there = pose.inverse().compose(Pose2D(float(x_m), float(y_m)))
    return there.x_m, there.y_m


def _pursue(
    params: FollowerParameters,
    outline: OutlineParameters,
    state: FollowState,
    track: Track,
    near: Surroundings,
    last: Twist2D,
    dt_s: float,
) -> Followed:
    wanted_m = abs(last.linear_m_s) * params.lookahead_s
    lookahead_m = min(max(wanted_m, params.least_lookahead_m), params.most_lookahead_m)
    x_m, y_m = _carrot(track.points_m, state.index, near.grid_from_base, lookahead_m)
    bearing_rad = math.atan2(y_m, x_m)
    limit_rad = params.aligned_rad if state.phase is Phase.TURNING else params.turn_on_the_spot_rad
    if abs(bearing_rad) > limit_rad:
        return _turn_by(params, outline, replace(state, phase=Phase.TURNING), bearing_rad, near, last, dt_s)
    state = replace(state, phase=Phase.TRACKING)
    away_m = max(math.hypot(x_m, y_m), 0.05)
    most = params.most_curvature_per_m
    curvature = min(max(2 * y_m / away_m**2, -most), most)
    curvature, found = _free_arc(params, outline, near, curvature, (x_m, y_m))
    curvature, found = _clear_arc(params, outline, near, curvature, found)
    if _is_clearer_turned(params, outline, near, bearing_rad, away_m, found):
        return _turn_by(params, outline, replace(state, phase=Phase.TURNING), bearing_rad, near, last, dt_s)
    free_m = found.free
    if near.velocity_m_s.any() and free_m < _way(params, outline, standing_only(near), curvature).free - 0.05:
        free_m = min(free_m, _way(params, outline, swept(params.arcs, near), curvature).free)
    room_m = free_m - 0.02
    if free_m < params.arcs.horizon_m:
        stopping = stopping_speed(room_m, params.deceleration_m_s2, params.delay_s)
    else:
        stopping = math.inf
    end = track.points_m[-1] - [near.grid_from_base.x_m, near.grid_from_base.y_m]
    left_m = max(_length(track.points_m[state.index :]), float(np.hypot(*end)))
    arriving = stopping_speed(left_m, params.deceleration_m_s2, params.delay_s)
    in_curve = params.curve_turn_rad_s / max(abs(curvature), 1e-6)
    speed = min(params.max_speed_m_s, track.speed_limit_m_s, found.speed_m_s, in_curve, stopping, arriving)
    if stopping < params.least_speed_m_s:
        return Followed(state, slewed(params, last, STANDING, dt_s), is_blocked=True)
    return Followed(state, _on_arc(params, last, max(speed, params.least_speed_m_s), curvature, dt_s))


def _free_arc(
    params: FollowerParameters,
    outline: OutlineParameters,
    near: Surroundings,
    curvature: float,
    carrot: tuple[float, float],
) -> tuple[float, Way]:
    """The arc to the carrot, or, where that is not free far enough, the best of those about it."""
    first = _way(params, outline, near, curvature)
    enough_m = min(0.6, math.hypot(*carrot) + 0.2)
    if first.free >= enough_m:
        return curvature, first
    best, chosen = _worth(first, curvature, curvature, carrot), (curvature, first)
    for step in (0.4, 0.8, 1.3, 2.0, 3.0, 4.5):
        for side in (-step, step):
            tried = curvature + side
            if abs(tried) > params.most_curvature_per_m:
                continue
            found = _way(params, outline, near, tried)
            worth = _worth(found, tried, curvature, carrot)
            if worth > best:
                best, chosen = worth, (tried, found)
    return chosen


def _clear_arc(
    params: FollowerParameters,
    outline: OutlineParameters,
    near: Surroundings,
    curvature: float,
    found: Way,
    horizon_m: float | None = None,
) -> tuple[float, Way]:
    """The same arc, or one a little beside it that leaves more room to what stands, and is as free."""
    best, chosen = CLEAR_WORTH * found.lacking_m, (curvature, found)
    if found.lacking_m < SLIGHT_M:
        return chosen
    for step in (0.4, 0.8, 1.2, 1.8):
        off_m = step * params.arcs.keep_for_m**2 / 2
        for side in (-step, step):
            tried = curvature + side
            if abs(tried) > params.most_curvature_per_m:
                continue
            other = _way(params, outline, near, tried, horizon_m)
            worth = CLEAR_WORTH * other.lacking_m + off_m
            if worth < best and other.free >= min(found.free, 0.6) - 1e-6:
                best, chosen = worth, (tried, other)
    return chosen


def _is_clearer_turned(
    params: FollowerParameters,
    outline: OutlineParameters,
    near: Surroundings,
    bearing_rad: float,
    away_m: float,
    found: Way,
) -> bool:
    """Whether turning on the spot before driving leaves more room than the arc that was found."""
    if found.lacking_m < TURN_GAIN_M or abs(bearing_rad) <= params.aligned_rad:
        return False
    free_rad = turn(params.arcs, outline, near, bearing_rad).free
    straight = _way(params, outline, turned(near, bearing_rad), 0.0, away_m)
    is_clearer = straight.lacking_m + TURN_GAIN_M < found.lacking_m
    return is_clearer and straight.free >= away_m - 1e-6 and free_rad >= abs(bearing_rad) - 1e-6


def _way(
    params: FollowerParameters,
    outline: OutlineParameters,
    near: Surroundings,
    curvature: float,
    horizon_m: float | None = None,
) -> Way:
    """An arc forwards, or, backwards, one with a negative horizon."""
    horizon_m = params.arcs.horizon_m if horizon_m is None else horizon_m
    most = params.max_speed_m_s if horizon_m > 0 else params.max_reverse_m_s
    limit = min(most, params.curve_turn_rad_s / max(abs(curvature), 1e-6))
    return way(params.arcs, outline, near, curvature, horizon_m, limit, params.deceleration_m_s2)


def _worth(found: Way, curvature: float, wanted: float, carrot: tuple[float, float]) -> float:
    """Free way counts most, then ending near the carrot, room beside, and the curvature that was wanted."""
    half = curvature * math.hypot(*carrot) / 2
    chord = math.hypot(*carrot) * (math.sin(half) / half if abs(half) > 1e-6 else 1.0)
    off_m = math.hypot(chord * math.cos(half) - carrot[0], chord * math.sin(half) - carrot[1])
    beside_m = 0.3 * min(found.room_m, 0.2) - CLEAR_WORTH * found.lacking_m
    return min(found.free, 0.6) - 0.8 * off_m + beside_m - 0.02 * abs(curvature - wanted)


def _approach(
    params: FollowerParameters,
    outline: OutlineParameters,
    state: FollowState,
    end: Floats,
    near: Surroundings,
    last: Twist2D,
    dt_s: float,
) -> Followed:
    """Straight to the end: turn towards it, drive, and drive back if it lies just behind."""
    there = near.grid_from_base.inverse().compose(Pose2D(float(end[0]), float(end[1])))
    away_m, bearing_rad = math.hypot(there.x_m, there.y_m), math.atan2(there.y_m, there.x_m)
    direction = 1.0
    if abs(bearing_rad) > 2.0 and away_m < 0.12:
        direction, bearing_rad = -1.0, wrap_angle(bearing_rad + math.pi)
    if abs(bearing_rad) > 0.35 and away_m > params.position_m:
        return _turn_by(params, outline, state, bearing_rad, near, last, dt_s)
    curvature = min(max(2 * there.y_m / max(away_m, 0.08) ** 2, -4.0), 4.0)
    found = way(
        params.arcs, outline, near, curvature, direction * (away_m + 0.02), params.max_speed_m_s,
        params.deceleration_m_s2,
    )  # fmt: skip
    stopping = stopping_speed(away_m * math.cos(bearing_rad), params.deceleration_m_s2 / 2, params.delay_s)
    free = math.inf
    if found.free < away_m:
        free = stopping_speed(found.free - 0.01, params.deceleration_m_s2, params.delay_s)
    if free < params.least_speed_m_s:
        return Followed(state, slewed(params, last, STANDING, dt_s), is_blocked=True)
    most = params.max_speed_m_s if direction > 0 else params.max_reverse_m_s
    speed = max(min(stopping, most, found.speed_m_s, free), params.least_speed_m_s)
    return Followed(state, _on_arc(params, last, direction * speed, curvature, dt_s))


def _final_turn(
    params: FollowerParameters,
    outline: OutlineParameters,
    state: FollowState,
    track: Track,
    near: Surroundings,
    last: Twist2D,
    dt_s: float,
    to_end_m: float,
) -> Followed:
    standing = slewed(params, last, STANDING, dt_s)
    error_rad = 0.0
    if track.end_heading_rad is not None:
        error_rad = wrap_angle(track.end_heading_rad - near.grid_from_base.heading_rad)
    if abs(last.linear_m_s) > 1e-3:
        return Followed(state, Twist2D(standing.linear_m_s, 0.0))
    if abs(error_rad) > params.heading_rad:
        return _turn_by(params, outline, state, error_rad, near, last, dt_s)
    if abs(last.angular_rad_s) > 1e-3:
        return Followed(state, STANDING)
    if to_end_m > 1.1 * params.position_m:
        return Followed(replace(state, phase=Phase.APPROACHING), standing)
    return Followed(replace(state, phase=Phase.DONE), STANDING)


def _turn_by(
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


def _on_arc(
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


def backwards(
    params: FollowerParameters,
    outline: OutlineParameters,
    trail: Floats,
    near: Surroundings,
    last: Twist2D,
    dt_s: float,
) -> Followed:
    """Back along the way the robot came (n, 2 in the grid's frame, the newest first), as long as it is free."""
    state = FollowState()
    away = np.hypot(trail[:, 0] - near.grid_from_base.x_m, trail[:, 1] - near.grid_from_base.y_m)
    beyond = np.flatnonzero(away >= 0.2)
    target = trail[int(beyond[0])] if len(beyond) else trail[-1]
    there = near.grid_from_base.inverse().compose(Pose2D(float(target[0]), float(target[1])))
    away_m = max(math.hypot(there.x_m, there.y_m), 0.05)
    curvature = min(max(2 * there.y_m / away_m**2, -3.0), 3.0) if there.x_m < 0 else 0.0
    found = _way(params, outline, near, curvature, BACK_M)
    curvature, found = _clear_arc(params, outline, near, curvature, found, BACK_M)
    stopping = stopping_speed(found.free - 0.02, params.deceleration_m_s2, params.delay_s)
    speed = min(params.max_reverse_m_s, stopping)
    if speed < params.least_speed_m_s:
        return Followed(state, slewed(params, last, STANDING, dt_s), is_blocked=True)
    return Followed(state, _on_arc(params, last, -speed, curvature, dt_s))
