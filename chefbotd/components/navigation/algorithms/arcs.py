"""Computes how far and how fast the robot can drive along an arc before its outline comes too near to something.

What a lidar sees is checked point by point against the robot's true outline, at each pose along the arc; no grid rounds
it. A point that is too near already forbids only what brings it nearer, so the robot can always leave.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from chefbotd.components.navigation.algorithms.costmap import between_cells
from chefbotd.components.navigation.algorithms.grid import Flags, Floats, Singles
from chefbotd.components.navigation.algorithms.outline import Footprint, clearance_m
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.record import Record

STEP_M, STEP_RAD = 0.025, 0.05
PASSING_S = 0.2
COMING_M = 0.003
"""A point that is too near already may come nearer by this, which is noise."""

REACTION_M = 0.05
"""An obstacle so near limits the speed at once; a farther one only as much as braking until then requires."""


MARGIN_M: Final = 0.015
"""From what stands on the map: the lidar's noise, and no more, so that narrow doors are passed."""

UNMAPPED_MARGIN_M: Final = 0.03
"""From what is not on the map: a chair's leg is seen, its seat is not, and people move."""

HORIZON_M: Final = 1.0
MAP_SLACK_M: Final = 0.06
"""So much nearer to an obstacle of the map than the inner radius stops the robot though no lidar sees it: its cell
    and its pose are not exact."""

CREEP_M_S: Final = 0.08
"""The speed with no room at all beside the robot."""

FULL_SPEED_ROOM_M: Final = 0.20
"""With so much room it goes as fast as it may."""

MOVING_MARGIN_M: Final = 0.08
"""On top of that from a person who walks, or stands for a moment: where he will be is a guess."""

FORESIGHT_S: Final = 2.5
"""A person is expected to walk on as now for so long."""

EARLY_S: Final = 0.3
"""A person may arrive so much earlier than expected,"""

LATE_S: Final = 0.5
"""and the robot so much later: it passes in front of him only with that much time to spare."""

STAYS_S: Final = 1.5
"""Where the robot will stop, no person may pass for so long."""

KEEP_M: Final = 0.13
"""The robot keeps this distance from standing obstacles where there is room,"""

KEEP_FOR_M: Final = 0.35
"""along so much of its path: beyond that it will have turned."""


class Arc(Record, frozen=True):
    """An arc: how much is free (metres, or radians on the spot), the least room beside it, the speed that allows.

    ``lacking_m`` is by how much it comes nearer than ``KEEP_M`` to standing obstacles along ``KEEP_FOR_M``: the average,
    and half of the worst on top.
    """

    free: float
    room_m: float
    speed_m_s: float
    lacking_m: float = 0.0


class _Motion(NamedTuple):  # a kernel takes it, and numba knows no record
    """The robot's motion, for a kernel: the pad of its outline, its speed and the most allowed, and how it brakes.

    No obstacle of the map may come nearer than ``map_least_m``. The robot stands after ``stops_m``. A walking person is
    expected to walk on for ``foresight_s``.
    """

    pad_m: float
    map_least_m: float
    max_speed_m_s: float
    deceleration_m_s2: float
    speed_m_s: float
    stops_m: float
    foresight_s: float


def check_arc(
    outline: Footprint,
    surroundings: Surroundings,
    curvature_per_m: float,
    horizon_m: float,
    max_speed_m_s: float,
    deceleration_m_s2: float,
    *,
    foresight_s: float = FORESIGHT_S,
) -> Arc:
    """Forward along an arc (CCW positive), or backward with a negative horizon."""
    motion = _motion(outline, surroundings, max_speed_m_s, deceleration_m_s2, foresight_s)
    return Arc(*_check(*_arrays(outline, surroundings), motion, curvature_per_m, horizon_m, 0.0))


def check_turn(outline: Footprint, surroundings: Surroundings, angle_rad: float) -> Arc:
    """Turning on the spot by an angle (CCW positive)."""
    motion = _motion(outline, surroundings, 1.0, 1.0, FORESIGHT_S)
    return Arc(*_check(*_arrays(outline, surroundings), motion, 0.0, 0.0, angle_rad))


def nearest_in_turn(outline: Footprint, surroundings: Surroundings, angle_rad: float) -> int:
    """The point that a turn on the spot brings too near first; if there is none, the one that is nearest now."""
    return int(
        _nearest_in_turn(outline.hull, outline.pad_m, surroundings.points_m, surroundings.margin_m, angle_rad)
    )


def _arrays(
    outline: Footprint, surroundings: Surroundings
) -> tuple[Floats, Floats, Floats, Flags, Floats, Singles, float, Floats]:
    pose = surroundings.grid_from_base
    robot_pose = np.array([pose.x_m, pose.y_m, pose.heading_rad])
    walks: Flags = np.asarray(surroundings.velocity_m_s.any(axis=1))
    if surroundings.is_walker is not None:
        walks &= surroundings.is_walker
    points, velocity = surroundings.points_m, surroundings.velocity_m_s
    return (
        outline.hull,
        points,
        velocity,
        walks,
        surroundings.margin_m,
        surroundings.fixed_m,
        surroundings.cell_m,
        robot_pose,
    )


def _motion(
    outline: Footprint,
    surroundings: Surroundings,
    max_speed_m_s: float,
    deceleration_m_s2: float,
    foresight_s: float,
) -> _Motion:
    return _Motion(
        outline.pad_m,
        outline.inner_radius_m - MAP_SLACK_M,
        float(max_speed_m_s),
        float(deceleration_m_s2),
        float(surroundings.speed_m_s),
        float(surroundings.stops_m),
        foresight_s,
    )


@kernel
def _check(
    hull: Floats,
    points: Floats,
    velocity: Floats,
    walks: Flags,
    margin: Floats,
    fixed_m: Singles,
    cell_m: float,
    robot_pose: Floats,
    motion: _Motion,
    curvature: float,
    horizon_m: float,
    angle_rad: float,
) -> tuple[float, float, float, float]:
    """Free length or angle (0 or more), least room, allowed speed, lacking room."""
    pad_m, most, braking = motion.pad_m, motion.max_speed_m_s, motion.deceleration_m_s2
    stops_m, foresight_s = motion.stops_m, motion.foresight_s
    on_the_spot = horizon_m == 0.0
    total = angle_rad if on_the_spot else horizon_m
    count = max(math.ceil(abs(total) / (STEP_RAD if on_the_spot else STEP_M)), 1)
    least = _least_allowed(hull, pad_m, points, margin)
    map_least_m = min(
        motion.map_least_m, between_cells(fixed_m, cell_m, robot_pose[0], robot_pose[1]) - COMING_M
    )
    cos_0, sin_0 = math.cos(robot_pose[2]), math.sin(robot_pose[2])
    free, room_m, speed = abs(total), math.inf, most
    lacking_m, most_lacking_m, kept = 0.0, 0.0, 0
    for k in range(1, count + 1):
        s = total * k / count
        x, y, heading = (0.0, 0.0, s) if on_the_spot else along_arc(s, curvature)
        soon_s = time_s = min(abs(s) if on_the_spot else abs(s) / max(most, 0.05), foresight_s)
        if not on_the_spot:
            time_s = _time_s(
                min(abs(s), stops_m), math.copysign(1.0, total) * motion.speed_m_s, braking, most
            )
        from_s, until_s = max(min(time_s, foresight_s) - EARLY_S, 0.0), min(time_s, foresight_s) + LATE_S
        if abs(s) >= stops_m:
            until_s = min(time_s, foresight_s) + STAYS_S
        times = soon_s, min(time_s, foresight_s), from_s, until_s
        nearest, standing = _nearest(hull, pad_m, points, velocity, walks, least, x, y, heading, times)
        map_m = math.inf
        if not on_the_spot:
            grid_x, grid_y = robot_pose[0] + cos_0 * x - sin_0 * y, robot_pose[1] + sin_0 * x + cos_0 * y
            map_m = between_cells(fixed_m, cell_m, grid_x, grid_y)
        if nearest == -math.inf or map_m < map_least_m:
            free = abs(total) * (k - 1) / count
            break
        room_m = min(room_m, nearest)
        if abs(s) <= KEEP_FOR_M:
            lacks_m = max(KEEP_M - standing, 0.0)
            lacking_m, most_lacking_m, kept = lacking_m + lacks_m, max(most_lacking_m, lacks_m), kept + 1
        allowed = CREEP_M_S + (most - CREEP_M_S) * min(max(nearest, 0.0) / FULL_SPEED_ROOM_M, 1.0)
        ahead_m = max(abs(s) - REACTION_M, 0.0)
        speed = min(speed, math.sqrt(allowed * allowed + 2 * braking * ahead_m))
    return free, max(room_m, 0.0), speed, lacking_m / max(kept, 1) + 0.5 * most_lacking_m


@kernel
def _time_s(s: float, speed_now: float, acceleration: float, most: float) -> float:
    """When a robot that goes as fast as it may has gone so far."""
    most = max(most, 0.05)
    begin = min(max(speed_now, 0.0), most)
    faster_m = (most * most - begin * begin) / (2 * acceleration)
    if s < faster_m:
        return (math.sqrt(begin * begin + 2 * acceleration * s) - begin) / acceleration
    return (most - begin) / acceleration + (s - faster_m) / most


@kernel
def along_arc(s: float, curvature: float) -> tuple[float, float, float]:
    """Where a robot is, and its heading, after a length of an arc (backwards with a negative one) from the origin."""
    heading = curvature * s
    half = heading / 2
    chord = s * (math.sin(half) / half if abs(half) > 1e-6 else 1.0)
    return chord * math.cos(half), chord * math.sin(half), heading


@kernel
def _least_allowed(hull: Floats, pad_m: float, points: Floats, margin: Floats) -> Floats:
    """How near each point may come: what is too near already, no nearer."""
    least = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        least[i] = min(margin[i], clearance_m(hull, pad_m, points[i, 0], points[i, 1]) - COMING_M)
    return least


@kernel
def _nearest_in_turn(hull: Floats, pad_m: float, points: Floats, margin: Floats, angle_rad: float) -> int:
    """The index of the first point that a turn on the spot brings too near, or of the one that is nearest now."""
    least = _least_allowed(hull, pad_m, points, margin)
    count = math.ceil(abs(angle_rad) / STEP_RAD)
    for k in range(1, count + 1):
        cos, sin = math.cos(angle_rad * k / count), math.sin(angle_rad * k / count)
        for i in range(points.shape[0]):
            x, y = points[i, 0], points[i, 1]
            if clearance_m(hull, pad_m, cos * x + sin * y, cos * y - sin * x) < least[i]:
                return i
    nearest, nearest_m = 0, math.inf
    for i in range(points.shape[0]):
        apart_m = clearance_m(hull, pad_m, points[i, 0], points[i, 1])
        if apart_m < nearest_m:
            nearest, nearest_m = i, apart_m
    return nearest


@kernel
def _nearest(
    hull: Floats,
    pad_m: float,
    points: Floats,
    velocity: Floats,
    walks: Flags,
    least: Floats,
    x: float,
    y: float,
    heading: float,
    times: tuple[float, float, float, float],
) -> tuple[float, float]:
    """The least room at a pose, to all and to what stands; minus infinity where a point is too near.

    The first of these times is for what only seems to move, the second for who walks. He may not come too near at any
    time between the last two.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    nearest, standing = math.inf, math.inf
    soon_s, time_s, from_s, until_s = times
    steps = math.ceil((until_s - from_s) / PASSING_S)
    for i in range(points.shape[0]):
        stands = velocity[i, 0] == 0.0 and velocity[i, 1] == 0.0
        for k in range(-1, steps + 1 if walks[i] else 0):
            at_s = min(from_s + k * PASSING_S, until_s) if k >= 0 else time_s if walks[i] else soon_s
            dx = points[i, 0] + velocity[i, 0] * at_s - x
            dy = points[i, 1] + velocity[i, 1] * at_s - y
            apart = clearance_m(hull, pad_m, cos * dx + sin * dy, cos * dy - sin * dx)
            if apart < least[i]:
                return -math.inf, -math.inf
            if k < 0:
                nearest = min(nearest, apart)
            if stands:
                standing = min(standing, apart)
    return nearest, standing


def stopping_speed(room: float, deceleration: float, delay_s: float) -> float:
    """The speed from which the robot stands after ``room``: ``v t + v^2 / 2a``. For angles alike."""
    if room <= 0:
        return 0.0
    return deceleration * (math.sqrt(delay_s * delay_s + 2 * room / deceleration) - delay_s)
