"""What was seen since the map was made: marked where a beam ended, cleared where one passed, faded with time.

A beam without a return clears nothing: glass, black cloth and sunlight return nothing either. What a lidar saw is
cleared by a lidar's beam that ends behind it. What an ultrasonic or infrared sensor saw nobody clears, since it may be
glass: it fades after a stated time; and where the map or the lidar already explains such an echo, it marks nothing.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from chefbotd.core.compiled import kernel
from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters
from chefbotd.navigation.costmap import Cells
from chefbotd.navigation.distance import Singles
from chefbotd.navigation.grid_frame import Floats, GridFrame

NEVER_S = -math.inf
"""When a cell was seen occupied that never was."""


class LiveParameters(Parameters):
    """For how long what was seen is remembered, and what the map already explains."""

    scan_kept_s: float = Field(default=60.0, gt=0, le=3600)
    """What the lidar saw, and no beam has passed since, is forgotten after this."""
    range_kept_s: float = Field(default=3.0, gt=0, le=600)
    """The same for ultrasonic and infrared sensors."""
    range_at_most_m: float = Field(default=1.5, gt=0, le=10)
    """Beyond, their cones are too wide to say where an obstacle is."""
    explained_m: float = Field(default=0.12, ge=0, le=1)
    """What is seen so near to an obstacle of the map is that obstacle."""
    cone_explained_m: float = Field(default=0.15, ge=0, le=1)
    """The same for a cone, whose distance is less certain."""


@dataclass(frozen=True, slots=True)
class LiveObstacles:
    """For each cell when it was last seen occupied, (rows, columns): by lidar, and by a cone of sound or light."""

    scan_s: Floats
    range_s: Floats


def nothing_seen(frame: GridFrame) -> LiveObstacles:
    """Nothing was seen yet."""
    shape = (frame.rows, frame.columns)
    return LiveObstacles(np.full(shape, NEVER_S), np.full(shape, NEVER_S))


def see_scan(
    live: LiveObstacles, frame: GridFrame, stamp_s: float, sensor_m: Floats, points_m: Floats
) -> LiveObstacles:
    """Mark the points and clear the way to them; sensor and points (n, 2) are in the grid's frame."""
    scan_s = live.scan_s.copy()
    _see(scan_s, frame.resolution_m, stamp_s, sensor_m, points_m)
    return replace(live, scan_s=scan_s)


@kernel
def _see(scan_s: Floats, cell_m: float, stamp_s: float, sensor_m: Floats, points_m: Floats) -> None:
    rows, columns = scan_s.shape
    for i in range(points_m.shape[0]):
        row, column = math.floor(points_m[i, 1] / cell_m), math.floor(points_m[i, 0] / cell_m)
        if 0 <= row < rows and 0 <= column < columns:
            scan_s[row, column] = stamp_s
    for i in range(points_m.shape[0]):
        dx, dy = points_m[i, 0] - sensor_m[0], points_m[i, 1] - sensor_m[1]
        length_m = math.hypot(dx, dy)
        steps = int((length_m - cell_m) / (0.5 * cell_m))
        for k in range(steps):
            along = k * 0.5 * cell_m / length_m
            column = math.floor((sensor_m[0] + along * dx) / cell_m)
            row = math.floor((sensor_m[1] + along * dy) / cell_m)
            if not (0 <= row < rows and 0 <= column < columns):
                continue
            if scan_s[row, column] > -math.inf and not _just_seen(scan_s, row, column, stamp_s):
                scan_s[row, column] = -math.inf


@kernel
def _just_seen(scan_s: Floats, row: int, column: int, stamp_s: float) -> bool:
    """Whether a beam of this scan ended here or beside it: a beam along a surface must not clear the surface."""
    rows, columns = scan_s.shape
    for r in range(max(row - 1, 0), min(row + 2, rows)):
        for c in range(max(column - 1, 0), min(column + 2, columns)):
            if scan_s[r, c] == stamp_s:
                return True
    return False


def see_range(
    params: LiveParameters,
    live: LiveObstacles,
    frame: GridFrame,
    fixed_m: Singles,
    stamp_s: float,
    grid_from_sensor: Pose2D,
    range_m: float,
    field_of_view_rad: float,
) -> LiveObstacles:
    """Mark the arc at ``range_m`` across a sensor's cone, unless something known explains the echo.

    ``fixed_m`` is each cell's distance to the nearest obstacle of the map.
    """
    if not 0 < range_m <= params.range_at_most_m:
        return live
    half = field_of_view_rad / 2
    count = max(math.ceil(2 * half * range_m / (0.5 * frame.resolution_m)), 1)
    bearings = grid_from_sensor.heading_rad + np.linspace(-half, half, count + 1)
    cells = []
    for bearing in bearings:
        x_m = grid_from_sensor.x_m + range_m * math.cos(bearing)
        y_m = grid_from_sensor.y_m + range_m * math.sin(bearing)
        cell = frame.cell(x_m, y_m)
        if cell is not None:
            cells.append(cell)
    reach = math.ceil(params.cone_explained_m / frame.resolution_m)
    if any(_explained(params, live, fixed_m, cell, reach, stamp_s) for cell in cells):
        return live
    range_s = live.range_s.copy()
    for cell in cells:
        range_s[cell] = stamp_s
    return replace(live, range_s=range_s)


def _explained(
    params: LiveParameters,
    live: LiveObstacles,
    fixed_m: Singles,
    cell: tuple[int, int],
    reach: int,
    now_s: float,
) -> bool:
    row, column = cell
    if fixed_m[cell] <= params.cone_explained_m:
        return True
    about = live.scan_s[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1]
    return bool((about > now_s - params.scan_kept_s).any())


def obstacles_seen(params: LiveParameters, live: LiveObstacles, fixed_m: Singles, now_s: float) -> Cells:
    """The cells (n, 2) that are occupied now, and that the map does not explain."""
    since_scan_s, since_range_s = now_s - params.scan_kept_s, now_s - params.range_kept_s
    found = ((live.scan_s > since_scan_s) | (live.range_s > since_range_s)) & (fixed_m > params.explained_m)
    return np.argwhere(found)
