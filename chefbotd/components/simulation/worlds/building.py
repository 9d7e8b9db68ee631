"""A building that comes with the simulator, and its map at the height of a lidar."""

import math
from collections.abc import Iterator, Mapping, Sequence
from enum import IntEnum
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from chefbotd.components.simulation.arrays import Vector
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from chefbotd.core.record import Record

CEILING_M = 2.5
WALL_M = 0.1
SEAT_M, CHAIR_M, BACK_M, CHAIR_LEG_M = 0.45, 0.42, 0.9, 0.04


class Material(IntEnum):
    """What a surface makes of a lidar's beam: returns it, swallows most of it, or lets it through."""

    PLAIN = 0
    BLACK = 1
    GLASS = 2


class Solid(Record, frozen=True, eq=False):
    """A prism over the convex polygon ``corners`` (N x 2, counter-clockwise, metres) from ``bottom_m`` to ``top_m``."""

    name: str
    corners: Vector
    bottom_m: float
    top_m: float
    material: Material = Material.PLAIN


class Placement(Record, frozen=True):
    """A corner of something and how it is turned about that corner: where its parts go."""

    x_m: float
    y_m: float
    turn_rad: float = 0.0

    def corners(self, x_m: float, y_m: float, width_m: float, depth_m: float) -> Vector:
        """The rectangle of this size whose first corner is at (x, y) from the place."""
        far_x_m, far_y_m = x_m + width_m, y_m + depth_m
        local = np.array([[x_m, y_m], [far_x_m, y_m], [far_x_m, far_y_m], [x_m, far_y_m]])
        cos, sin = math.cos(self.turn_rad), math.sin(self.turn_rad)
        placed: Vector = local @ np.array([[cos, sin], [-sin, cos]]) + [self.x_m, self.y_m]
        return placed


def box(
    name: str,
    place: Placement,
    width_m: float,
    depth_m: float,
    top_m: float,
    bottom_m: float = 0.0,
    material: Material = Material.PLAIN,
) -> Solid:
    """A cupboard, a bed, a piece of wall."""
    return Solid(name, place.corners(0, 0, width_m, depth_m), bottom_m, top_m, material)


def table(
    name: str,
    place: Placement,
    width_m: float,
    depth_m: float,
    top_m: float = 0.72,
    leg_m: float = 0.06,
    thickness_m: float = 0.03,
) -> Iterator[Solid]:
    """A top on four legs, which stand in its corners."""
    yield Solid(name, place.corners(0, 0, width_m, depth_m), top_m - thickness_m, top_m)
    for x_m in (0.0, width_m - leg_m):
        for y_m in (0.0, depth_m - leg_m):
            yield Solid(name, place.corners(x_m, y_m, leg_m, leg_m), 0.0, top_m - thickness_m)


def chair(name: str, place: Placement) -> Iterator[Solid]:
    """A seat on four legs, with a back along its y axis at x = 0: who sits on it looks along x."""
    yield from table(name, place, CHAIR_M, CHAIR_M, SEAT_M, CHAIR_LEG_M)
    yield Solid(name, place.corners(0, 0, CHAIR_LEG_M, CHAIR_M), SEAT_M, BACK_M)


def column(name: str, x_m: float, y_m: float, radius_m: float, top_m: float) -> Solid:
    """Something round: with twelve sides."""
    angles = np.arange(12) * (math.tau / 12)
    corners: Vector = radius_m * np.stack((np.cos(angles), np.sin(angles)), axis=1) + [x_m, y_m]
    return Solid(name, corners, 0.0, top_m)


class Door(Record, frozen=True):
    """A gap in a wall: how far along the axis it begins, and how wide it is."""

    name: str
    at_m: float
    width_m: float


def level_wall(
    y_m: float, from_x_m: float, to_x_m: float, doors: Sequence[Door] = (), thick_m: float = WALL_M
) -> Iterator[Solid]:
    """A wall along x whose lower side is at ``y_m``, open at its doors (in rising order)."""
    for begin, end in _between(from_x_m, to_x_m, doors):
        yield box("wall", Placement(begin, y_m), end - begin, thick_m, CEILING_M)


def upright_wall(
    x_m: float, from_y_m: float, to_y_m: float, doors: Sequence[Door] = (), thick_m: float = WALL_M
) -> Iterator[Solid]:
    """A wall along y whose left side is at ``x_m``, open at its doors (in rising order)."""
    for begin, end in _between(from_y_m, to_y_m, doors):
        yield box("wall", Placement(x_m, begin), thick_m, end - begin, CEILING_M)


def _between(begin_m: float, end_m: float, doors: Sequence[Door]) -> Iterator[tuple[float, float]]:
    edges = [begin_m, *(edge for door in doors for edge in (door.at_m, door.at_m + door.width_m)), end_m]
    return ((begin, end) for begin, end in list(pairwise(edges))[::2])


def level_door(door: Door, y_m: float) -> Solid:
    """What closes a door in a wall along x."""
    return box(door.name, Placement(door.at_m, y_m + 0.03), door.width_m, 0.04, 2.0)


def upright_door(door: Door, x_m: float) -> Solid:
    """What closes a door in a wall along y."""
    return box(door.name, Placement(x_m + 0.03, door.at_m), 0.04, door.width_m, 2.0)


RESOLUTION_M = 0.02
MARGIN_M = 0.2
SLICE_M = 0.2
"""The height of a lidar on a small robot (assumed): what a map shows."""


class Building(Record, frozen=True):
    """Walls and furniture; what closes its doors; where a robot starts; a free point in each room; a drive through them.

    ``outside`` are points that are seen through glass.
    """

    name: str
    solids: tuple[Solid, ...]
    doors: tuple[Solid, ...]
    start: Pose2D
    rooms: Mapping[str, tuple[float, float]]
    tour: tuple[tuple[float, float], ...]
    outside: tuple[tuple[float, float], ...] = ()

    def grid(self) -> OccupancyGrid:
        """The map with its doors open, in cells of 2 cm.

        Free is what is connected with a room, or with what is seen through glass; the inside of furniture is occupied.
        """
        corners = np.concatenate([solid.corners for solid in self.solids])
        low = np.floor((corners.min(axis=0) - MARGIN_M) / RESOLUTION_M) * RESOLUTION_M
        columns, rows = np.ceil((corners.max(axis=0) + MARGIN_M - low) / RESOLUTION_M).astype(int)
        occupied = np.zeros((rows, columns), np.bool_)
        for solid in self.solids:
            if solid.bottom_m <= SLICE_M < solid.top_m:
                _fill(occupied, (solid.corners - low) / RESOLUTION_M)
        percent = np.full((rows, columns), UNKNOWN, np.int8)
        percent[_find_connected(~occupied, *self._air(low))] = FREE
        percent[occupied] = OCCUPIED
        return OccupancyGrid(RESOLUTION_M, Pose2D(float(low[0]), float(low[1])), percent)

    def _air(self, low: Vector) -> list[tuple[int, int]]:
        """The cells (row, column) from which air spreads."""
        points = [*self.rooms.values(), *self.outside]
        return [(int((y - low[1]) / RESOLUTION_M), int((x - low[0]) / RESOLUTION_M)) for x, y in points]


def _fill(cells: npt.NDArray[np.bool_], corners: Vector) -> None:
    """Set the cells whose middles lie in a convex polygon, given counter-clockwise in cells; in place."""
    left, bottom = np.floor(corners.min(axis=0)).astype(int)
    right, top = np.ceil(corners.max(axis=0)).astype(int)
    x, y = np.meshgrid(np.arange(left, right) + 0.5, np.arange(bottom, top) + 0.5)
    within = np.ones(x.shape, np.bool_)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        within &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0
    cells[bottom:top, left:right] |= within


def _find_connected(free: npt.NDArray[np.bool_], *seeds: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """The free cells that are connected with a seed: spread along rows and columns until nothing more is reached."""
    reached = np.zeros_like(free)
    for row, column in seeds:
        reached[row, column] = free[row, column]
    count = 0
    while (now := int(reached.sum())) != count:
        count = now
        for turned, open_cells in ((reached, free), (reached.T, free.T)):
            _spread(turned, open_cells)
            _spread(turned[:, ::-1], open_cells[:, ::-1])
    return reached


def _spread(reached: npt.NDArray[np.bool_], free: npt.NDArray[np.bool_]) -> None:
    """Onwards along axis 1, as far as it is free, from each cell that is reached; in place."""
    columns = np.arange(free.shape[1])
    blocked = np.maximum.accumulate(np.where(free, -1, columns), axis=1)
    source = np.maximum.accumulate(np.where(reached, columns, -1), axis=1)
    reached |= free & (source > blocked)
