"""The solids of a building and its furniture: upright prisms between two heights."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

import numpy as np

from chefbotd.sim.arrays import Vector

CEILING_M = 2.5
WALL_M = 0.1
SEAT_M, CHAIR_M, BACK_M, CHAIR_LEG_M = 0.45, 0.42, 0.9, 0.04


class Material(IntEnum):
    """What a surface makes of a lidar's beam: returns it, swallows most of it, or lets it through."""

    PLAIN = 0
    BLACK = 1
    GLASS = 2


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A prism over the convex polygon ``corners`` (N x 2, counter-clockwise, metres) from ``bottom_m`` to ``top_m``."""

    name: str
    corners: Vector
    bottom_m: float
    top_m: float
    material: Material = Material.PLAIN


@dataclass(frozen=True, slots=True)
class Place:
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
    place: Place,
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
    place: Place,
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


def chair(name: str, place: Place) -> Iterator[Solid]:
    """A seat on four legs, with a back along its y axis at x = 0: who sits on it looks along x."""
    yield from table(name, place, CHAIR_M, CHAIR_M, SEAT_M, CHAIR_LEG_M)
    yield Solid(name, place.corners(0, 0, CHAIR_LEG_M, CHAIR_M), SEAT_M, BACK_M)


def column(name: str, x_m: float, y_m: float, radius_m: float, top_m: float) -> Solid:
    """Something round: with twelve sides."""
    angles = np.arange(12) * (math.tau / 12)
    corners: Vector = radius_m * np.stack((np.cos(angles), np.sin(angles)), axis=1) + [x_m, y_m]
    return Solid(name, corners, 0.0, top_m)


@dataclass(frozen=True, slots=True)
class Door:
    """A gap in a wall: how far along the axis it begins, and how wide it is."""

    name: str
    at_m: float
    width_m: float


def level_wall(
    y_m: float, from_x_m: float, to_x_m: float, doors: Sequence[Door] = (), thick_m: float = WALL_M
) -> Iterator[Solid]:
    """A wall along x whose lower side is at ``y_m``, open at its doors (in rising order)."""
    for begin, end in _between(from_x_m, to_x_m, doors):
        yield box("wall", Place(begin, y_m), end - begin, thick_m, CEILING_M)


def upright_wall(
    x_m: float, from_y_m: float, to_y_m: float, doors: Sequence[Door] = (), thick_m: float = WALL_M
) -> Iterator[Solid]:
    """A wall along y whose left side is at ``x_m``, open at its doors (in rising order)."""
    for begin, end in _between(from_y_m, to_y_m, doors):
        yield box("wall", Place(x_m, begin), thick_m, end - begin, CEILING_M)


def _between(begin_m: float, end_m: float, doors: Sequence[Door]) -> Iterator[tuple[float, float]]:
    edges = [begin_m, *(edge for door in doors for edge in (door.at_m, door.at_m + door.width_m)), end_m]
    return ((begin, end) for begin, end in list(pairwise(edges))[::2])


def level_door(door: Door, y_m: float) -> Solid:
    """What closes a door in a wall along x."""
    return box(door.name, Place(door.at_m, y_m + 0.03), door.width_m, 0.04, 2.0)


def upright_door(door: Door, x_m: float) -> Solid:
    """What closes a door in a wall along y."""
    return box(door.name, Place(x_m + 0.03, door.at_m), 0.04, door.width_m, 2.0)
