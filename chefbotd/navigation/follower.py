"""Follows a path: regulated pure pursuit, then a straight approach and a turn to the goal's heading.

Macenski, Singh, Martin and Gines, "Regulated Pure Pursuit for Robot Path Tracking", Autonomous Robots 47, 2023: the
curvature leads to a point of the path ahead; curves, obstacles and the goal limit the speed. The arc is then checked
against what the lidar sees; where it is not free, the arcs about it are tried, as in the dynamic window (Fox, Burgard
and Thrun, 1997). Poses are predicted by the robot's delay, so that it does not oscillate at the end.
"""

import math

import numpy as np

from chefbotd.core.geometry import STANDING, Pose2D, Twist2D, wrap_angle
from chefbotd.core.record import replace
from chefbotd.navigation.arc_choice import arc, clear_arc, free_arc, is_clearer_turned
from chefbotd.navigation.arcs import FORESIGHT_S, HORIZON_M, Way, stopping_speed, way
from chefbotd.navigation.grid_frame import Floats
from chefbotd.navigation.outline import Footprint
from chefbotd.navigation.steering import (
    ALIGNED_RAD,
    APPROACH_M,
    BRAKING,
    LEAST_LOOKAHEAD_M,
    LOOKAHEAD_S,
    MOST_CURVATURE_PER_M,
    MOST_LOOKAHEAD_M,
    TURN_ON_THE_SPOT_RAD,
    Followed,
    FollowerLimits,
    FollowState,
    Phase,
    Track,
    on_arc,
    slewed,
    turn_by,
)
from chefbotd.navigation.surroundings import Surroundings, standing_only, swept

CLOSE_M = 0.006
"""A goal so near ahead is not driven to any more."""

BACK_M = -0.4
"""So far backwards it looks."""

HELD_M, STAYED_M = 0.06, 0.02
"""A robot that was asked to drive so far, and is no farther from where it was, is held back: an obstacle guard keeps
more distance from a wall than the goal has."""

MOST_HELD = 4
"""After so many approaches that were held back, forwards and backwards by turns, the goal is blocked."""


def follow(
    params: FollowerLimits,
    outline: Footprint,
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
    if state.phase is Phase.FINAL_TURN and to_end_m > APPROACH_M:  # it made way for somebody
        state = replace(state, phase=Phase.TRACKING)
    if state.phase is Phase.FINAL_TURN:
        return _final_turn(params, outline, state, track, near, last, dt_s, to_end_m)
    if to_end_m < APPROACH_M and left_m < 2 * APPROACH_M:
        state = _held(replace(state, phase=Phase.APPROACHING), pose, last, dt_s)
        return _approach(params, outline, state, end, near, last, dt_s)
    return _pursue(params, outline, state, track, near, last, dt_s)


def _is_there(params: FollowerLimits, pose: Pose2D, end: Floats, to_end_m: float, last: Twist2D) -> bool:
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
    params: FollowerLimits,
    outline: Footprint,
    state: FollowState,
    track: Track,
    near: Surroundings,
    last: Twist2D,
    dt_s: float,
) -> Followed:
    wanted_m = abs(last.linear_m_s) * LOOKAHEAD_S
    lookahead_m = min(max(wanted_m, LEAST_LOOKAHEAD_M), MOST_LOOKAHEAD_M)
    x_m, y_m = _carrot(track.points_m, state.index, near.grid_from_base, lookahead_m)
    bearing_rad, away_m = math.atan2(y_m, x_m), max(math.hypot(x_m, y_m), 0.05)
    limit_rad = ALIGNED_RAD if state.phase is Phase.TURNING else TURN_ON_THE_SPOT_RAD
    turning = replace(state, phase=Phase.TURNING)
    if abs(bearing_rad) > limit_rad:
        return turn_by(params, outline, turning, bearing_rad, near, last, dt_s)
    state = replace(state, phase=Phase.TRACKING)
    end = track.points_m[-1] - [near.grid_from_base.x_m, near.grid_from_base.y_m]
    left_m = max(_length(track.points_m[state.index :]), float(np.hypot(*end)))
    near = replace(near, stops_m=left_m)
    most = MOST_CURVATURE_PER_M
    curvature = min(max(2 * y_m / away_m**2, -most), most)
    curvature, found = free_arc(params, outline, near, curvature, (x_m, y_m))
    curvature, found = clear_arc(params, outline, near, curvature, found)
    if is_clearer_turned(params, outline, near, bearing_rad, away_m, found):
        return turn_by(params, outline, turning, bearing_rad, near, last, dt_s)
    stopping = _stopping(params, outline, near, curvature, found)
    if stopping < params.least_speed_m_s:
        return Followed(state, slewed(params, last, STANDING, dt_s), is_blocked=True)
    arriving = stopping_speed(left_m, params.deceleration_m_s2, params.delay_s)
    in_curve = params.curve_turn_rad_s / max(abs(curvature), 1e-6)
    speed = min(params.max_speed_m_s, track.speed_limit_m_s, found.speed_m_s, in_curve, stopping, arriving)
    return Followed(state, on_arc(params, last, max(speed, params.least_speed_m_s), curvature, dt_s))


def _stopping(
    params: FollowerLimits, outline: Footprint, near: Surroundings, curvature: float, found: Way
) -> float:
    """From which speed the robot stands before what is in its way: clear of all of his way before who walks."""
    free_m = found.free
    if near.velocity_m_s.any() and free_m < arc(params, outline, standing_only(near), curvature).free - 0.05:
        free_m = min(free_m, arc(params, outline, swept(near, FORESIGHT_S), curvature).free)
    if free_m >= HORIZON_M:
        return math.inf
    return stopping_speed(free_m - 0.02, params.deceleration_m_s2, params.delay_s)


def _held(state: FollowState, pose: Pose2D, last: Twist2D, dt_s: float) -> FollowState:
    """The same, with how often the robot was asked to drive and stayed where it is."""
    here = (pose.x_m, pose.y_m)
    if state.from_m is None or math.dist(state.from_m, here) > STAYED_M:
        return replace(state, from_m=here, asked_m=0.0)
    asked_m = state.asked_m + abs(last.linear_m_s) * dt_s
    if asked_m < HELD_M:
        return replace(state, asked_m=asked_m)
    return replace(state, held=state.held + 1, from_m=here, asked_m=0.0)


def _approach(
    params: FollowerLimits,
    outline: Footprint,
    state: FollowState,
    end: Floats,
    near: Surroundings,
    last: Twist2D,
    dt_s: float,
) -> Followed:
    """Straight to the end: turn towards it, drive, and drive back if it lies just behind.

    Who was held back on the way forwards turns round and backs in: the sensors that look ahead keep the most distance.
    """
    there = near.grid_from_base.inverse().compose(Pose2D(float(end[0]), float(end[1])))
    away_m, bearing_rad = math.hypot(there.x_m, there.y_m), math.atan2(there.y_m, there.x_m)
    if state.held >= MOST_HELD:
        return Followed(state, slewed(params, last, STANDING, dt_s), is_blocked=True)
    direction = 1.0
    if state.held % 2 or (abs(bearing_rad) > 2.0 and away_m < 0.12):
        direction, bearing_rad = -1.0, wrap_angle(bearing_rad + math.pi)
    if abs(bearing_rad) > 0.35 and away_m > params.position_m:
        return turn_by(params, outline, state, bearing_rad, near, last, dt_s)
    curvature = min(max(2 * there.y_m / max(away_m, 0.08) ** 2, -4.0), 4.0)
    near = replace(near, stops_m=away_m)
    found = way(
        outline, near, curvature, direction * (away_m + 0.02), params.max_speed_m_s,
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
    return Followed(state, on_arc(params, last, direction * speed, curvature, dt_s))


def _final_turn(
    params: FollowerLimits,
    outline: Footprint,
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
        return turn_by(params, outline, state, error_rad, near, last, dt_s)
    if abs(last.angular_rad_s) > 1e-3:
        return Followed(state, STANDING)
    if to_end_m > 1.1 * params.position_m:
        return Followed(replace(state, phase=Phase.APPROACHING), standing)
    return Followed(replace(state, phase=Phase.DONE), STANDING)


def backwards(
    params: FollowerLimits,
    outline: Footprint,
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
    found = arc(params, outline, near, curvature, BACK_M)
    curvature, found = clear_arc(params, outline, near, curvature, found, BACK_M)
    stopping = stopping_speed(found.free - 0.02, params.deceleration_m_s2, params.delay_s)
    speed = min(params.max_reverse_m_s, stopping)
    if speed < params.least_speed_m_s:
        return Followed(state, slewed(params, last, STANDING, dt_s), is_blocked=True)
    return Followed(state, on_arc(params, last, -speed, curvature, dt_s))
