"""Computes the cost of each cell from the map, its zones, and new obstacles.

The distance to the nearest obstacle decides. Nearer than the robot's inner radius a cell is blocked; with no more than
``comfort_m`` beyond it, it costs up to ``1 + wall_weight``, falling with the square of the room; with more it costs 1.
With no more than ``tight_m`` it costs up to ``tight_weight`` on top of that: there the robot drives slowly.
"""

import math
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from chefbotd.components.navigation.algorithms.grid import Flags, Floats, GridFrame, Singles, distances_m
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.search import BLOCKED, SearchGrid, prepare_costs
from chefbotd.components.navigation.algorithms.states import UnknownSpace
from chefbotd.components.navigation.algorithms.zones import keep_out_cells, speed_limits_m_s
from chefbotd.components.worker.compiled import kernel
from chefbotd.components.zones.zone_file import NO_ZONES, Zones
from chefbotd.core.occupancy_grid import UNKNOWN, OccupancyGrid
from chefbotd.core.record import Record, replace

OCCUPIED_PERCENT: Final = 65
"""Cells from here on are obstacles, as for map_server."""

UNKNOWN_WEIGHT: Final = 5.0
"""What an unknown cell costs more, where it is avoided."""

COMFORT_M: Final = 0.30
"""Room beside the outline from which on more room is worth nothing."""

WALL_WEIGHT: Final = 4.0
"""A cell with no room beside the robot costs so much more than a free one."""

TIGHT_M: Final = 0.12
TIGHT_WEIGHT: Final = 3.0
"""With less room than ``TIGHT_M`` beside the outline a cell costs up to so much more: a detour is often cheaper."""

UNMAPPED_MARGIN_M: Final = 0.04
"""Paths keep at least so far from obstacles that are not on the map: farther than what stops the robot."""

ROUNDING_CELLS: Final = 0.5
"""So much nearer than the inner radius is still free, since a wall is anywhere in its cell: without it a door at an
angle, 6 cm wider than the robot, might be closed in a grid of 5 cm. What is too narrow is measured by the lidar."""

WHERE_IT_WAS_M_S: Final = 0.1
"""So fast the robot drives over a place where a thing of the map was taken away."""


class GuardDistances(Record, frozen=True):
    """The obstacle guards stop the robot so far before what is ahead, on top of the room that they keep all round it."""

    stop_m: float = 0.0
    clearance_m: float = 0.0


NO_GUARDS: Final = GuardDistances()


class Inflation(Record, frozen=True):
    """The parameters, in metres from an obstacle, for one robot."""

    blocked_below_m: float
    inner_m: float
    unmapped_below_m: float
    comfort_m: float
    weight: float
    tight_m: float
    tight_weight: float
    guards: GuardDistances = NO_GUARDS

    @property
    def reach_m(self) -> float:
        """An obstacle changes the costs no farther than this."""
        return self.inner_m + max(self.comfort_m, self.tight_m)


class Costmap(Record, frozen=True, gc=True, dict=True):
    """Arrays (rows, columns): distance to the nearest obstacle, cost (infinite: blocked), a zone's speed limit.

    ``surcharges`` is what a cell costs by itself, apart from obstacles: 1, more in slow zones and unknown space,
    infinite where it is blocked whatever is near. ``standing_m`` are the distances without people, ``fixed_m`` without
    all that was seen since. ``walls`` are the obstacles of the map, without zones.
    """

    frame: GridFrame
    inflation: Inflation
    distance_m: Singles
    costs: Singles
    surcharges: Singles
    standing_m: Singles
    fixed_m: Singles
    speed_limit_m_s: Floats
    walls: Flags

    @cached_property
    def search_grid(self) -> SearchGrid:
        """The costs, prepared for searches once."""
        return prepare_costs(self.costs)


def costmap(
    outline: Footprint,
    grid: OccupancyGrid,
    max_speed_m_s: float,
    zones: Zones = NO_ZONES,
    closed: Flags | None = None,
    *,
    unknown_space: UnknownSpace = UnknownSpace.BLOCKED,
    comfort_m: float = COMFORT_M,
    guards: GuardDistances = NO_GUARDS,
) -> Costmap:
    """The costs of a map, its zones, and cells that are ``closed`` as those of a keep-out zone are.

    A slow zone costs the time that it takes: ``max_speed_m_s`` is the speed elsewhere.
    """
    frame = GridFrame.of(grid)
    walls: Flags = grid.percent >= OCCUPIED_PERCENT
    obstacles = walls | keep_out_cells(zones, frame)
    if closed is not None:
        obstacles |= closed
    distance_m = distances_m(obstacles, grid.resolution_m)
    limits = speed_limits_m_s(zones, frame)
    surcharges = np.maximum(1.0, max_speed_m_s / limits).astype(np.float32)
    unknown = grid.percent == UNKNOWN
    if unknown_space is UnknownSpace.BLOCKED:
        surcharges[unknown] = BLOCKED
    elif unknown_space is UnknownSpace.AVOIDED:
        surcharges[unknown] += np.float32(UNKNOWN_WEIGHT)
    inner_m = outline.inner_radius_m
    blocked_below_m = inner_m - ROUNDING_CELLS * grid.resolution_m
    unmapped_below_m = inner_m + UNMAPPED_MARGIN_M
    inflation = Inflation(
        blocked_below_m, inner_m, unmapped_below_m,
        comfort_m, WALL_WEIGHT, TIGHT_M, TIGHT_WEIGHT, guards,
    )  # fmt: skip
    costs = np.empty_like(distance_m)
    _fill(distance_m, surcharges, _numbers(inflation, blocked_below_m), costs)
    return Costmap(frame, inflation, distance_m, costs, surcharges, distance_m, distance_m, limits, walls)


def with_obstacles(ground: Costmap, points_m: Floats) -> Costmap:
    """The costmap with more obstacles: points (n, 2) in the grid's frame, each exactly where it is."""
    if not len(points_m):
        return ground
    distance_m, costs = ground.distance_m.copy(), ground.costs.copy()
    numbers = _numbers(ground.inflation, ground.inflation.unmapped_below_m)
    _stamp(points_m, ground.frame.resolution_m, numbers, ground.surcharges, distance_m, costs)
    return replace(ground, distance_m=distance_m, standing_m=distance_m, costs=costs)


def without_thing(ground: Costmap, cells: NDArray[np.int64]) -> Costmap:
    """The costs of a map from which a thing with these cells (n, 2) was taken away; zones stay.

    The robot creeps where it was: what is too low for a lidar may be left.
    """
    cell_m, its = ground.frame.resolution_m, ground.inflation
    low, high = cells.min(axis=0), cells.max(axis=0) + 1

    def box(pad_m: float) -> tuple[slice, slice]:
        pad = math.ceil(pad_m / cell_m)
        rows, columns = (slice(max(a - pad, 0), b + pad) for a, b in zip(low, high, strict=True))
        return rows, columns

    walls, distance_m, costs = ground.walls.copy(), ground.distance_m.copy(), ground.costs.copy()
    surcharges, limits = ground.surcharges.copy(), ground.speed_limit_m_s.copy()
    keep_out = (distance_m == 0) & ~walls
    walls[cells[:, 0], cells[:, 1]] = False
    inner, outer = box(its.reach_m + cell_m), box(2 * its.reach_m + 2 * cell_m)
    around = distances_m(walls[outer] | keep_out[outer], cell_m)
    rows, columns = (
        slice(of_inner.start - of_outer.start, min(of_inner.stop, size) - of_outer.start)
        for of_inner, of_outer, size in zip(inner, outer, walls.shape, strict=True)
    )
    distance_m[inner] = around[rows, columns]
    within = box(0.0)
    was = np.zeros(walls.shape, np.bool_)
    was[cells[:, 0], cells[:, 1]] = True
    inside = ndimage.binary_fill_holes(was[within])
    surcharges[within] = np.where(inside & np.isinf(surcharges[within]), 1.0, surcharges[within])
    limits[box(its.inner_m)] = np.minimum(limits[box(its.inner_m)], WHERE_IT_WAS_M_S)
    near_m, surcharge = (
        distance_m[inner].copy(),
        surcharges[inner].copy(),
    )  # whole arrays, as ``_fill`` is compiled for
    part = np.empty_like(near_m)
    _fill(near_m, surcharge, _numbers(its, its.blocked_below_m), part)
    costs[inner] = part
    return replace(
        ground, walls=walls, distance_m=distance_m, standing_m=distance_m, fixed_m=distance_m,
        costs=costs, surcharges=surcharges, speed_limit_m_s=limits,
    )  # fmt: skip


def _numbers(inflation: Inflation, blocked_below_m: float) -> Floats:
    its = inflation
    return np.array([blocked_below_m, its.inner_m, its.comfort_m, its.weight, its.tight_m, its.tight_weight])


@kernel
def _cost(distance_m: float, inflation: Floats) -> float:
    if distance_m < inflation[0]:
        return math.inf
    room_m = max(distance_m - inflation[1], 0.0)
    lacking = max(1.0 - room_m / inflation[2], 0.0)
    tight = max(1.0 - room_m / inflation[4], 0.0)
    return float(1.0 + inflation[3] * lacking * lacking + inflation[5] * tight * tight)


@kernel
def _fill(distance_m: Singles, surcharges: Singles, inflation: Floats, costs: Singles) -> None:
    for row in range(costs.shape[0]):
        for column in range(costs.shape[1]):
            costs[row, column] = _cost(distance_m[row, column], inflation) * surcharges[row, column]


@kernel
def _stamp(
    points_m: Floats,
    cell_m: float,
    inflation: Floats,
    surcharges: Singles,
    distance_m: Singles,
    costs: Singles,
) -> None:
    rows, columns = costs.shape
    reach = int((inflation[1] + inflation[2]) / cell_m) + 1
    for i in range(points_m.shape[0]):
        x, y = points_m[i, 0] / cell_m - 0.5, points_m[i, 1] / cell_m - 0.5
        middle_row, middle_column = math.floor(y + 0.5), math.floor(x + 0.5)
        for row in range(max(middle_row - reach, 0), min(middle_row + reach + 1, rows)):
            for column in range(max(middle_column - reach, 0), min(middle_column + reach + 1, columns)):
                apart_m = math.hypot(row - y, column - x) * cell_m
                if row == middle_row and column == middle_column:
                    apart_m = 0.0
                if apart_m < distance_m[row, column]:
                    distance_m[row, column] = apart_m
                    cost = _cost(apart_m, inflation) * surcharges[row, column]
                    costs[row, column] = max(cost, costs[row, column])


@kernel
def between_cells(values: Singles, resolution_m: float, x_m: float, y_m: float) -> float:
    """A value between the middles of cells, bilinear; beyond the outermost ones that of the nearest."""
    rows, columns = values.shape
    across = min(max(x_m / resolution_m - 0.5, 0.0), columns - 1.0)
    down = min(max(y_m / resolution_m - 0.5, 0.0), rows - 1.0)
    column, row = min(int(across), columns - 2), min(int(down), rows - 2)
    if column < 0 or row < 0:
        return float(values[max(row, 0), max(column, 0)])
    u, v = across - column, down - row
    lower = (1 - u) * values[row, column] + u * values[row, column + 1]
    upper = (1 - u) * values[row + 1, column] + u * values[row + 1, column + 1]
    return float((1 - v) * lower + v * upper)


@kernel
def between_cells_at(values: Singles, resolution_m: float, points_m: Floats) -> Floats:
    """The same at each of the points (n, 2)."""
    result = np.empty(points_m.shape[0])
    for i in range(points_m.shape[0]):
        result[i] = between_cells(values, resolution_m, points_m[i, 0], points_m[i, 1])
    return result
