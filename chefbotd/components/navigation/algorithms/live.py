"""Obstacles that are not on the map: marked where a beam ended, cleared where one passed, faded with time.

A beam without a return clears nothing: glass, black cloth and sunlight return nothing either. What a lidar saw is
cleared by a lidar's beam that ends behind it. What an ultrasonic or infrared sensor saw nobody clears, since it may be
glass: it fades after a stated time; and where the map or the lidar already explains such an echo, it marks nothing.
"""

import math
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.navigation.algorithms.grid import Flags, Floats, GridFrame, Singles
from chefbotd.components.navigation.algorithms.movers import WALKER_S
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record

Counts = NDArray[np.uint8]

PASSES = 3
"""A cell beside the end of a beam is cleared when beams only passed it in so many scans in a row."""

AVERAGED = 0.3
"""The place of an obstacle within its cell is averaged with this share for each beam."""

NEVER_S = -math.inf
"""The time at which a free cell was seen occupied."""


SCAN_KEPT_S: Final = 60.0
"""What the lidar saw, and no beam has passed since, is remembered so long at most;"""

BRIEF_KEPT_S: Final = 4.0
"""what it saw for a moment only, so long: a person who went by is elsewhere by then."""

KEPT_SHARE: Final = 4.0
"""In between, an obstacle is remembered so many times as long as it was seen."""

RANGE_KEPT_S: Final = 3.0
"""The same for ultrasonic and infrared sensors."""

RANGE_AT_MOST_M: Final = 1.5
"""Farther away, their cones are too wide to place an obstacle."""

EXPLAINED_M: Final = 0.12
"""A point so near to an obstacle of the map belongs to it."""

CONE_EXPLAINED_M: Final = 0.15
"""The same for a cone, whose distance is less certain."""


class LiveObstacles(Record, frozen=True):
    """For each cell when it was last seen occupied, (rows, columns): by lidar, and by a cone of sound or light.

    ``since_s`` is since when the lidar sees it there, ``passes`` in how many scans since then beams only passed.
    ``at_m`` (rows, columns, 2) is where in the cell it is, so that a gap does not lose two cells to rounding.
    These arrays are filled in place: to copy those of a whole map takes longer than to mark a scan.
    """

    scan_s: Floats
    range_s: Floats
    since_s: Floats
    passes: Counts
    at_m: Floats


def nothing_seen(frame: GridFrame) -> LiveObstacles:
    """Nothing was seen yet."""
    shape = (frame.rows, frame.columns)
    scan_s, range_s = np.full(shape, NEVER_S), np.full(shape, NEVER_S)
    return LiveObstacles(scan_s, range_s, np.zeros(shape), np.zeros(shape, np.uint8), np.zeros((*shape, 2)))


def part_of(live: LiveObstacles, box: tuple[slice, slice]) -> LiveObstacles:
    """What was seen in these rows and columns."""
    return LiveObstacles(
        live.scan_s[box], live.range_s[box], live.since_s[box], live.passes[box], live.at_m[box]
    )


def see_scan(
    live: LiveObstacles, frame: GridFrame, stamp_s: float, sensor_m: Floats, points_m: Floats
) -> LiveObstacles:
    """Mark the points and clear the way to them; sensor and points (n, 2) are in the grid's frame.

    It uses up ``live``, whose grids it fills. ``sensor_m`` is one place (2,), or one for each point (n, 2).
    """
    sensors = np.atleast_2d(sensor_m)
    _see(live.scan_s, live.since_s, live.passes, live.at_m, frame.resolution_m, stamp_s, sensors, points_m)
    return live


@kernel
def _see(
    scan_s: Floats,
    since_s: Floats,
    passes: Counts,
    at_m: Floats,
    cell_m: float,
    stamp_s: float,
    sensors: Floats,
    points_m: Floats,
) -> None:
    rows, columns = scan_s.shape
    for i in range(points_m.shape[0]):
        row, column = math.floor(points_m[i, 1] / cell_m), math.floor(points_m[i, 0] / cell_m)
        if 0 <= row < rows and 0 <= column < columns:
            share = AVERAGED
            if scan_s[row, column] == -math.inf:
                share, since_s[row, column] = 1.0, stamp_s
            for axis in range(2):
                at_m[row, column, axis] += share * (points_m[i, axis] - at_m[row, column, axis])
            scan_s[row, column], passes[row, column] = stamp_s, 0
    counted = np.zeros((rows, columns), np.bool_)
    for i in range(points_m.shape[0]):
        s = min(i, sensors.shape[0] - 1)
        x, y = sensors[s, 0] / cell_m, sensors[s, 1] / cell_m  # in cells from here on
        dx, dy = points_m[i, 0] / cell_m - x, points_m[i, 1] / cell_m - y
        length = math.hypot(dx, dy)
        along_x, along_y = 0.5 * dx / length, 0.5 * dy / length
        for k in range(int(2.0 * (length - 1.0))):
            column, row = math.floor(x + k * along_x), math.floor(y + k * along_y)
            if not (0 <= row < rows and 0 <= column < columns):
                continue
            if -math.inf < scan_s[row, column] < stamp_s and not counted[row, column]:
                counted[row, column] = True
                passes[row, column] += 1
                if passes[row, column] >= PASSES or not _just_seen(scan_s, row, column, stamp_s):
                    scan_s[row, column] = -math.inf


@kernel
def _just_seen(scan_s: Floats, row: int, column: int, stamp_s: float) -> bool:
    """Whether a beam of this scan ended here or beside: then the cell may be the edge of an obstacle."""
    rows, columns = scan_s.shape
    for r in range(max(row - 1, 0), min(row + 2, rows)):
        for c in range(max(column - 1, 0), min(column + 2, columns)):
            if scan_s[r, c] == stamp_s:
                return True
    return False


def is_marked(live: LiveObstacles, frame: GridFrame, points_m: Floats) -> Flags:
    """At which of the points (n, 2), or in the cells beside, a lidar saw something that no beam has cleared since."""
    columns, rows = np.floor(points_m / frame.resolution_m).astype(np.int64).T
    marked: Flags = np.zeros(len(points_m), np.bool_)
    for down, across in product((-1, 0, 1), repeat=2):
        row, column = rows + down, columns + across
        inside = (row >= 0) & (row < frame.rows) & (column >= 0) & (column < frame.columns)
        marked[inside] |= live.scan_s[row[inside], column[inside]] > NEVER_S
    return marked


def moved_with(
    live: LiveObstacles, frame: GridFrame, around: Pose2D, correction: Pose2D, reach_m: float
) -> LiveObstacles:
    """Only what was seen within ``reach_m`` of a pose, where ``correction`` takes it (both of the grid's frame)."""
    rows, columns = np.nonzero(live.scan_s > NEVER_S)
    at_m = live.at_m[rows, columns]
    near = np.hypot(at_m[:, 0] - around.x_m, at_m[:, 1] - around.y_m) <= reach_m
    rows, columns, at_m = rows[near], columns[near], at_m[near]
    cos, sin = math.cos(correction.heading_rad), math.sin(correction.heading_rad)
    moved_m = at_m @ np.array([[cos, sin], [-sin, cos]]) + [correction.x_m, correction.y_m]
    to_columns, to_rows = np.floor(moved_m / frame.resolution_m).astype(np.int64).T
    inside = (to_rows >= 0) & (to_rows < frame.rows) & (to_columns >= 0) & (to_columns < frame.columns)
    moved, to = nothing_seen(frame), (to_rows[inside], to_columns[inside])
    since = (rows[inside], columns[inside])
    moved.scan_s[to], moved.since_s[to], moved.at_m[to] = (
        live.scan_s[since],
        live.since_s[since],
        moved_m[inside],
    )
    return moved


def see_range(
    live: LiveObstacles,
    frame: GridFrame,
    fixed_m: Singles,
    stamp_s: float,
    grid_from_sensor: Pose2D,
    range_m: float,
    field_of_view_rad: float,
) -> LiveObstacles:
    """Mark the arc at ``range_m`` across a sensor's cone, unless the map or the lidar explains the echo.

    It uses up ``live``, whose grids it fills. ``fixed_m`` is each cell's distance to the nearest obstacle of the map.
    """
    if 0 < range_m <= RANGE_AT_MOST_M:
        count = max(math.ceil(field_of_view_rad * range_m / (0.5 * frame.resolution_m)), 1)
        bearings = np.linspace(-field_of_view_rad / 2, field_of_view_rad / 2, count + 1)
        bearings += grid_from_sensor.heading_rad
        ends = range_m * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        ends += [grid_from_sensor.x_m, grid_from_sensor.y_m]
        near_m, since_s = CONE_EXPLAINED_M, stamp_s - SCAN_KEPT_S
        if not _is_explained(live.scan_s, fixed_m, frame.resolution_m, ends, near_m, since_s):
            _hear(live.scan_s, live.range_s, live.at_m, frame.resolution_m, stamp_s, ends)
    return live


@kernel
def _is_explained(
    scan_s: Floats, fixed_m: Singles, cell_m: float, ends_m: Floats, near_m: float, since_s: float
) -> bool:
    """Whether the map has an obstacle near one of these places, or a lidar has seen one since then."""
    rows, columns = scan_s.shape
    reach = math.ceil(near_m / cell_m)
    for i in range(ends_m.shape[0]):
        row, column = math.floor(ends_m[i, 1] / cell_m), math.floor(ends_m[i, 0] / cell_m)
        if not (0 <= row < rows and 0 <= column < columns):
            continue
        if fixed_m[row, column] <= near_m:
            return True
        for r in range(max(row - reach, 0), min(row + reach + 1, rows)):
            for c in range(max(column - reach, 0), min(column + reach + 1, columns)):
                if scan_s[r, c] > since_s:
                    return True
    return False


@kernel
def _hear(
    scan_s: Floats, range_s: Floats, at_m: Floats, cell_m: float, stamp_s: float, ends_m: Floats
) -> None:
    rows, columns = scan_s.shape
    for i in range(ends_m.shape[0]):
        row, column = math.floor(ends_m[i, 1] / cell_m), math.floor(ends_m[i, 0] / cell_m)
        if 0 <= row < rows and 0 <= column < columns:
            range_s[row, column] = stamp_s
            if scan_s[row, column] == -math.inf:
                at_m[row, column, 0], at_m[row, column, 1] = (column + 0.5) * cell_m, (row + 0.5) * cell_m


def obstacles_seen(
    live: LiveObstacles, fixed_m: Singles, now_s: float, walked_s: Floats | None = None
) -> Floats:
    """Obstacles that the map does not explain: points (n, 2) in the grid's frame, one for each cell.

    ``walked_s`` is when a person last walked over each cell. If the lidar saw nothing there since, that was the person,
    and is excluded. What it has seen there for longer than a person stands is a chair beside him.
    """
    rows, columns = np.nonzero(is_occupied(live, now_s) & (fixed_m > EXPLAINED_M))
    if walked_s is not None:
        seen_s = live.scan_s[rows, columns]
        stood = seen_s - live.since_s[rows, columns] > WALKER_S
        is_heard = live.range_s[rows, columns] > now_s - RANGE_KEPT_S
        kept = (seen_s > walked_s[rows, columns]) | is_heard | stood
        rows, columns = rows[kept], columns[kept]
    return live.at_m[rows, columns]


def is_occupied(live: LiveObstacles, now_s: float) -> Flags:
    """Which cells are occupied, by what is remembered."""
    occupied: Flags = np.empty(live.scan_s.shape, np.bool_)
    kept = np.array([KEPT_SHARE, BRIEF_KEPT_S, SCAN_KEPT_S, RANGE_KEPT_S])
    _is_occupied(live.scan_s, live.since_s, live.range_s, kept, now_s, occupied)
    return occupied


@kernel
def _is_occupied(
    scan_s: Floats, since_s: Floats, range_s: Floats, kept: Floats, now_s: float, occupied: Flags
) -> None:
    share, brief_s, longest_s, heard_s = kept[0], kept[1], kept[2], kept[3]
    for row in range(occupied.shape[0]):
        for column in range(occupied.shape[1]):
            seen_s = scan_s[row, column]
            kept_s = min(max(share * (seen_s - since_s[row, column]), brief_s), longest_s)
            occupied[row, column] = now_s - seen_s < kept_s or range_s[row, column] > now_s - heard_s
