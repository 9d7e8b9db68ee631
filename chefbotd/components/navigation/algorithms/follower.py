"""Follows a path: regulated pure pursuit, then a straight approach and a turn to the goal's heading.

Macenski, Singh, Martin and Gines, "Regulated Pure Pursuit for Robot Path Tracking", Autonomous Robots 47, 2023: the
curvature leads to a point of the path ahead; curves, obstacles and the goal limit the speed. The arc is then checked
against what the lidar sees; if it is not free, the arcs beside it are tried, as in the dynamic window (Fox, Burgard
and Thrun, 1997). Poses are predicted by the robot's delay, so that it does not oscillate at the end.
"""

import math

import numpy as np

from chefbotd.components.navigation.algorithms.arc_choice import (
    BEYOND_M,
    clear_arc,
    free_arc,
    is_clearer_turned,
    limited_arc,
)
from chefbotd.components.navigation.algorithms.arcs import (
    FORESIGHT_S,
    HORIZON_M,
    Arc,
    check_arc,
    stopping_speed,
)
from chefbotd.components.navigation.algorithms.grid import Floats
from chefbotd.components.navigation.algorithms.steering import (
    ALIGNED_RAD,
    APPROACH_M,
    BRAKING,
    LEAST_LOOKAHEAD_M,
    LOOKAHEAD_S,
    MOST_CURVATURE_PER_M,
    MOST_LOOKAHEAD_M,
    TIGHT_SHARE,
    TURN_ON_THE_SPOT_RAD,
    Control,
    Followed,
    FollowState,
    Phase,
    Track,
    on_arc,
    turn_by,
)
from chefbotd.components.navigation.algorithms.surroundings import standing_only, sweep_movers
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D, wrap_angle
from chefbotd.core.record import replace

CLOSE_M = 0.006
"""The robot does not drive on to a goal that is so near ahead."""

BACK_M = -0.4
"""It checks so far backwards."""

HELD_M, STAYED_M = 0.06, 0.02
"""A robot that was commanded to drive the first distance and moved less than the second is held back: an obstacle guard
keeps more distance from a wall than the goal has."""

BESIDE_M, TIGHT_M = 0.1, 0.08
"""Walls are beside the robot so far along it, and close up to here: it keeps its heading between them."""

BEYOND_END_M, IN_LINE_POINTS = 0.3, 4
"""There it steers for a point so far beyond the path's end, in line with its last points: nearer it would weave."""

GUARDED_AHEAD_M = 0.25
"""No guard stops the robot for what is farther ahead of its outline than this: the ultrasonic sensor keeps 0.15 m."""

MOST_HELD = 4
"""After so many approaches that were held back, forwards and backwards by turns, the goal is blocked."""


def follow(control: Control, state: FollowState, track: Track) -> Followed:
    """One step."""
    pose, points, last = control.surroundings.grid_from_base, track.points_m, control.last
    index = _nearest(points, state.index, pose)
    end = points[-1]
    to_end_m = math.hypot(end[0] - pose.x_m, end[1] - pose.y_m)
    left_m = _length(points[index:]) if len(points) - index < 40 else math.inf
    state = replace(state, index=index)
    if state.phase is Phase.DONE:
        return Followed(state, control.standing)
    if state.phase is not Phase.FINAL_TURN and _has_arrived(control, end, to_end_m):
        state = replace(state, phase=Phase.FINAL_TURN)
    if state.phase is Phase.FINAL_TURN and to_end_m > APPROACH_M:  # it evaded a person
        state = replace(state, phase=Phase.TRACKING)
    if state.phase is Phase.FINAL_TURN:
        return _final_turn(control, state, track, to_end_m)
    if to_end_m < APPROACH_M and left_m < 2 * APPROACH_M:
        state = replace(state, phase=Phase.APPROACHING)
        if _is_between_walls(control):  # which is no reason to turn round
            return _approach(control, state, track, steers_for=_beyond_end(control, points))
        return _approach(control, _count_standstill(state, pose, last, control.dt_s), track)
    return _pursue(control, state, track)


def _has_arrived(control: Control, end: Floats, to_end_m: float) -> bool:
    """Whether it is near enough; while it drives, only if braking takes it no nearer."""
    limits, speed_m_s = control.limits, control.last.linear_m_s
    if to_end_m >= limits.position_m:
        return False
    ahead_m = math.copysign(1.0, speed_m_s) * control.in_base(end).x_m
    braking_m = speed_m_s**2 / (2 * BRAKING * limits.deceleration_m_s2)
    return abs(speed_m_s) < 1e-3 or ahead_m < braking_m + CLOSE_M


def _nearest(points: Floats, index: int, pose: Pose2D) -> int:
    """The nearest point from the last one on, not more than 1 m of path beyond it."""
    ahead = points[index : index + 20]
    return index + int(np.argmin(np.hypot(ahead[:, 0] - pose.x_m, ahead[:, 1] - pose.y_m)))


def _length(points: Floats) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def _carrot(control: Control, points: Floats, *, is_tight: bool) -> tuple[float, float]:
    """In the robot's frame, where a path leaves the circle of the lookahead; its end if it does not."""
    pose, lookahead_m = control.surroundings.grid_from_base, abs(control.last.linear_m_s) * LOOKAHEAD_S
    lookahead_m = min(max(lookahead_m, LEAST_LOOKAHEAD_M), MOST_LOOKAHEAD_M) * (
        TIGHT_SHARE if is_tight else 1
    )
    away = np.hypot(points[:, 0] - pose.x_m, points[:, 1] - pose.y_m)
    beyond = np.flatnonzero(away >= lookahead_m)
    carrot = control.in_base(points[int(beyond[0])] if len(beyond) else points[-1])
    return carrot.x_m, carrot.y_m


def _pursue(control: Control, state: FollowState, track: Track) -> Followed:
    limits, pose = control.limits, control.surroundings.grid_from_base
    carrot = x_m, y_m = _carrot(control, track.points_m[state.index :], is_tight=track.is_tight)
    bearing_rad, away_m = math.atan2(y_m, x_m), max(math.hypot(x_m, y_m), 0.05)
    limit_rad = ALIGNED_RAD if state.phase is Phase.TURNING else TURN_ON_THE_SPOT_RAD
    turning = replace(state, phase=Phase.TURNING)
    if abs(bearing_rad) > limit_rad:
        return turn_by(control, turning, bearing_rad)
    state = replace(state, phase=Phase.TRACKING)
    end = track.points_m[-1] - [pose.x_m, pose.y_m]
    left_m = max(_length(track.points_m[state.index :]), float(np.hypot(*end)))
    control = replace(control, surroundings=replace(control.surroundings, stops_m=left_m))
    curvature = min(max(2 * y_m / away_m**2, -MOST_CURVATURE_PER_M), MOST_CURVATURE_PER_M)
    beyond_m = 0.0 if track.is_tight else BEYOND_M
    curvature, arc = clear_arc(control, *free_arc(control, curvature, carrot, beyond_m))
    if is_clearer_turned(control, bearing_rad, away_m, arc):
        return turn_by(control, turning, bearing_rad)
    stopping = _stopping(control, curvature, arc)
    if stopping < limits.least_speed_m_s:
        return Followed(state, control.standing, is_blocked=True)
    arriving = stopping_speed(left_m, limits.deceleration_m_s2, limits.delay_s)
    in_curve = limits.curve_turn_rad_s / max(abs(curvature), 1e-6)
    speed = min(limits.max_speed_m_s, track.speed_limit_m_s, arc.speed_m_s, in_curve, stopping, arriving)
    return Followed(state, on_arc(control, max(speed, limits.least_speed_m_s), curvature))


def _stopping(control: Control, curvature: float, arc: Arc) -> float:
    """From which speed the robot stands before what blocks the arc: clear of the whole path of a walking person."""
    surroundings, limits, free_m = control.surroundings, control.limits, arc.free
    if surroundings.velocity_m_s.any():
        standing = limited_arc(replace(control, surroundings=standing_only(surroundings)), curvature)
        if free_m < standing.free - 0.05:
            paths = replace(control, surroundings=sweep_movers(surroundings, FORESIGHT_S))
            free_m = min(free_m, limited_arc(paths, curvature).free)
    if free_m >= HORIZON_M:
        return math.inf
    return stopping_speed(free_m - 0.02, limits.deceleration_m_s2, limits.delay_s)


def _is_between_walls(control: Control) -> bool:
    """Whether walls close to its left and right keep the robot in line, and none is ahead."""
    half_m = float(np.abs(control.outline.hull[:, 1]).max()) + control.outline.pad_m
    x, y = control.surroundings.points_m.T
    beside = np.abs(x) < BESIDE_M
    left, right = (beside & (side > 0) & (side < half_m + TIGHT_M) for side in (y, -y))
    ahead = (np.abs(y) < half_m / 2) & (np.abs(x) < half_m + GUARDED_AHEAD_M)
    return bool(left.any() and right.any() and not ahead.any())


def _beyond_end(control: Control, points: Floats) -> Pose2D:
    """A point in line with the path's end, beyond it, in the robot's frame."""
    before = points[max(len(points) - 1 - IN_LINE_POINTS, 0)]
    along = points[-1] - before
    return control.in_base(points[-1] + BEYOND_END_M * along / max(float(np.hypot(*along)), 1e-6))


def _count_standstill(state: FollowState, pose: Pose2D, last: Twist2D, dt_s: float) -> FollowState:
    """The same, with how often the robot was commanded to drive and did not move."""
    place = (pose.x_m, pose.y_m)
    if state.from_m is None or math.dist(state.from_m, place) > STAYED_M:
        return replace(state, from_m=place, asked_m=0.0)
    asked_m = state.asked_m + abs(last.linear_m_s) * dt_s
    if asked_m < HELD_M:
        return replace(state, asked_m=asked_m)
    return replace(state, held=state.held + 1, from_m=place, asked_m=0.0)


def _approach(
    control: Control, state: FollowState, track: Track, steers_for: Pose2D | None = None
) -> Followed:
    """Straight to the end: turn towards it and drive, or drive backwards if it lies just behind.

    A robot that was held back on its way forwards turns round and backs in: the sensors ahead keep the most distance.
    """
    limits, goal = control.limits, control.in_base(track.points_m[-1])
    away_m, bearing_rad = math.hypot(goal.x_m, goal.y_m), math.atan2(goal.y_m, goal.x_m)
    if state.held >= MOST_HELD:
        return Followed(state, control.standing, is_blocked=True)
    direction = 1.0
    if state.held % 2 or (abs(bearing_rad) > 2.0 and away_m < 0.12):
        direction, bearing_rad = -1.0, wrap_angle(bearing_rad + math.pi)
    if abs(bearing_rad) > 0.35 and away_m > limits.position_m:
        return turn_by(control, state, bearing_rad)
    aim = goal if steers_for is None or direction < 0 else steers_for
    curvature = min(max(2 * aim.y_m / max(math.hypot(aim.x_m, aim.y_m), 0.08) ** 2, -4.0), 4.0)
    surroundings, horizon_m = replace(control.surroundings, stops_m=away_m), direction * (away_m + 0.02)
    braking = limits.deceleration_m_s2
    arc = check_arc(control.outline, surroundings, curvature, horizon_m, limits.max_speed_m_s, braking)
    arriving = stopping_speed(away_m * math.cos(bearing_rad), braking / 2, limits.delay_s)
    stopping = math.inf
    if arc.free < away_m:
        stopping = stopping_speed(arc.free - 0.01, braking, limits.delay_s)
    if stopping < limits.least_speed_m_s:
        return Followed(state, control.standing, is_blocked=True)
    most = limits.max_speed_m_s if direction > 0 else limits.max_reverse_m_s
    speed = min(most, track.speed_limit_m_s, arc.speed_m_s, stopping, arriving)
    speed = max(speed, limits.least_speed_m_s)
    return Followed(state, on_arc(control, direction * speed, curvature))


def _final_turn(control: Control, state: FollowState, track: Track, to_end_m: float) -> Followed:
    limits, last, error_rad = control.limits, control.last, 0.0
    if track.end_heading_rad is not None:
        error_rad = wrap_angle(track.end_heading_rad - control.surroundings.grid_from_base.heading_rad)
    if abs(last.linear_m_s) > 1e-3:
        return Followed(state, Twist2D(control.standing.linear_m_s, 0.0))
    if abs(error_rad) > limits.heading_rad:
        return turn_by(control, state, error_rad)
    if abs(last.angular_rad_s) > 1e-3:
        return Followed(state, STANDING)
    if to_end_m > 1.1 * limits.position_m:
        return Followed(replace(state, phase=Phase.APPROACHING), control.standing)
    return Followed(replace(state, phase=Phase.DONE), STANDING)


def backwards(control: Control, trail: Floats) -> Followed:
    """Back along the robot's trail (n, 2 in the grid's frame, the newest first), as long as it is free."""
    state, limits, pose = FollowState(), control.limits, control.surroundings.grid_from_base
    away = np.hypot(trail[:, 0] - pose.x_m, trail[:, 1] - pose.y_m)
    beyond = np.flatnonzero(away >= 0.2)
    target = control.in_base(trail[int(beyond[0])] if len(beyond) else trail[-1])
    away_m = max(math.hypot(target.x_m, target.y_m), 0.05)
    curvature = min(max(2 * target.y_m / away_m**2, -3.0), 3.0) if target.x_m < 0 else 0.0
    curvature, arc = clear_arc(control, curvature, limited_arc(control, curvature, BACK_M), BACK_M)
    stopping = stopping_speed(arc.free - 0.02, limits.deceleration_m_s2, limits.delay_s)
    speed = min(limits.max_reverse_m_s, stopping)
    if speed < limits.least_speed_m_s:
        return Followed(state, control.standing, is_blocked=True)
    return Followed(state, on_arc(control, -speed, curvature))
