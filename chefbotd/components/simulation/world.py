"""Walls and discs in the plane, which stop a round robot and a beam."""

import math
import sys
from collections.abc import Iterable
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.crowd import Crowd
from chefbotd.core.record import Record

REFERENCE_M = 0.3
"""How far from the place of reference the spans still hold."""

NOTHING = -1
ALONG_A_WALL: Final = 1e-300
"""In place of zero, where a beam runs along a wall; it changes no other sum."""

COMPILER: Final = "chefbotd.components.worker.compiled"


class Hits(Record, frozen=True):
    """For each beam its length (inf: it meets nothing), what it meets (``NOTHING``: a disc), and at which angle.

    ``square`` is the cosine between the beam and the normal of the face: 1 head-on, 0 grazing.
    """

    range_m: Vector
    edge: npt.NDArray[np.intp]
    square: Vector


Nearest: TypeAlias = tuple[Vector, npt.NDArray[np.intp], Vector]
"""For each beam the length, the column of the wall (``NOTHING``: none), and the cosine (1 where there is none)."""


def find_nearest(walls: Vector, origins: Vector, cos: Vector, sin: Vector) -> Nearest:
    """What beams meet first of walls (5 x S: x1, y1, x2 - x1, y2 - y1, length).

    No sum of a beam and a wall depends on the others. ``compiled_beams`` has the same sums.
    """
    beams = np.arange(len(origins))
    start_x, start_y, along_x, along_y, length_m = walls
    cos, sin = cos[:, None], sin[:, None]
    x, y = start_x - origins[:, :1], start_y - origins[:, 1:]
    turn = cos * along_y - sin * along_x
    turn += ALONG_A_WALL
    reach_m = (x * along_y - y * along_x) / turn
    share = (x * sin - y * cos) / turn
    share -= 0.5
    missed = np.abs(share, out=share) > 0.5
    missed |= reach_m < 0
    reach_m[missed] = np.inf
    column = reach_m.argmin(axis=1)
    range_m, square = reach_m[beams, column], np.abs(turn[beams, column]) / length_m[column]
    nothing = range_m == np.inf
    column[nothing], square[nothing] = NOTHING, 1.0
    return range_m, column, square


class RayCaster:
    """Beams against the same walls (S x 4: x1, y1, x2, y2) for as long as the place of reference is near."""

    def __init__(self, edges: Vector, reach_m: float) -> None:
        self._start, self._along = edges[:, :2], edges[:, 2:] - edges[:, :2]
        self._length = np.hypot(self._along[:, 0], self._along[:, 1])
        self._walls = np.ascontiguousarray(np.column_stack((self._start, self._along, self._length)).T)
        self._reach_m = reach_m
        self._reference = np.array([math.inf, math.inf])
        self._middle = self._half = np.zeros(0)
        self._number = np.zeros(0, np.intp)
        self._find_nearest = find_nearest

    def cast(self, origins: Vector, bearings_rad: Vector) -> Hits:
        """Where beams end that leave from ``origins`` (B x 2) at rising or falling bearings of the world frame."""
        return self.cast_apart(origins, bearings_rad, len(self._length))[0]

    def cast_apart(self, origins: Vector, bearings_rad: Vector, panes_from: int) -> tuple[Hits, Hits | None]:
        """The same, and where they pass the panes, which are the walls from this number on; None: there is none."""
        number, cos, sin = self._in_sight(origins, bearings_rad), np.cos(bearings_rad), np.sin(bearings_rad)
        split = int(number.searchsorted(panes_from))
        hits = self._hits(number[:split], origins, cos, sin)
        return hits, self._hits(number[split:], origins, cos, sin) if split < len(number) else None

    def _hits(self, number: npt.NDArray[np.intp], origins: Vector, cos: Vector, sin: Vector) -> Hits:
        if not len(number):
            count = len(origins)
            return Hits(np.full(count, np.inf), np.full(count, NOTHING), np.ones(count))
        range_m, column, square = self._find_nearest(self._walls.take(number, axis=1), origins, cos, sin)
        return Hits(range_m, np.where(column == NOTHING, NOTHING, number[column]), square)

    def _in_sight(self, origins: Vector, bearings_rad: Vector) -> npt.NDArray[np.intp]:
        """The walls whose spans of bearings meet the sector of the beams."""
        if np.abs(origins - self._reference).max() > REFERENCE_M / 2:
            self._refer(origins.mean(axis=0))
        middle = (bearings_rad[0] + bearings_rad[-1]) / 2
        half = abs(bearings_rad[-1] - bearings_rad[0]) / 2 + 1e-6
        if half >= math.pi:
            return self._number
        apart = np.abs((self._middle - middle + math.pi) % math.tau - math.pi)
        chosen: npt.NDArray[np.intp] = self._number[apart <= self._half + half]
        return chosen

    def _refer(self, place: Vector) -> None:
        """Work out each wall's span of bearings as seen from about this place; those out of reach are passed over."""
        self._reference = place
        if COMPILER in sys.modules:  # loaded by a worker in this process; nobody else waits for it
            from chefbotd.components.simulation import compiled_beams

            self._find_nearest = compiled_beams.find_nearest
        length_squared = np.maximum(self._length**2, 1e-12)
        share = np.clip(((place - self._start) * self._along).sum(axis=1) / length_squared, 0, 1)
        gap = self._start + share[:, None] * self._along - place
        distance = np.hypot(gap[:, 0], gap[:, 1])
        self._number = np.flatnonzero(distance <= self._reach_m + REFERENCE_M)
        first, distance = self._start[self._number] - place, distance[self._number]
        last = first + self._along[self._number]
        begin = np.arctan2(first[:, 1], first[:, 0])
        span = (np.arctan2(last[:, 1], last[:, 0]) - begin + math.pi) % math.tau - math.pi
        widening = np.arcsin(np.minimum(REFERENCE_M / np.maximum(distance, 1e-9), 1.0))
        self._middle = begin + span / 2
        self._half = np.where(distance <= REFERENCE_M, math.pi, np.abs(span) / 2 + widening)


def to_discs_m(origins: Vector, bearings_rad: Vector, discs: Vector) -> Vector:
    """How far each beam runs to the nearest disc (D x 3: x, y, radius); inf where it meets none, 0 within one."""
    if not len(discs):
        return np.full(len(bearings_rad), np.inf)
    cos, sin = np.cos(bearings_rad)[:, None], np.sin(bearings_rad)[:, None]
    dx, dy = discs[:, 0] - origins[:, :1], discs[:, 1] - origins[:, 1:]
    middle = dx * cos + dy * sin
    half_squared = discs[:, 2] ** 2 - (dx * sin - dy * cos) ** 2
    leave = middle + np.sqrt(np.maximum(half_squared, 0))
    enter = np.maximum(middle - np.sqrt(np.maximum(half_squared, 0)), 0)
    nearest: Vector = np.where((half_squared > 0) & (leave > 0), enter, np.inf).min(axis=1)
    return nearest


Point: TypeAlias = tuple[float, float]
PUSHES = 6
TOUCH_TOLERANCE_M = 1e-9
NO_DISCS: Vector = np.zeros((0, 3))


class World:
    """A set of wall segments in the world frame, S x 4: each row is x1, y1, x2, y2 in metres.

    ``discs`` (D x 3: x, y, radius) is where people and things are now: the crowd's, if there is one.
    """

    def __init__(
        self, walls: Vector | Iterable[tuple[float, float, float, float]], crowd: Crowd | None = None
    ) -> None:
        """Raises ``ValueError`` unless there is at least one wall, each with a length."""
        rows = np.asarray(walls if isinstance(walls, np.ndarray) else list(walls), dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != 4 or not len(rows):
            raise ValueError(f"walls must be S x 4 with S >= 1, got shape {rows.shape}")
        self._start, self._along = rows[:, :2], rows[:, 2:] - rows[:, :2]
        self._length_squared = (self._along**2).sum(axis=1)
        if not self._length_squared.all():
            raise ValueError("a wall has no length")
        self._crowd = crowd

    @property
    def discs(self) -> Vector:
        """Where people and things are now."""
        return NO_DISCS if self._crowd is None else self._crowd.discs

    def clearance_m(self, point: Point) -> float:
        """Distance from the point to the nearest wall."""
        return self._nearest(point)[0]

    def _nearest(self, point: Point) -> tuple[float, Vector]:
        """Distance and position of the nearest spot on any wall."""
        here = np.asarray(point)
        share = ((here - self._start) * self._along).sum(axis=1) / self._length_squared
        spots = self._start + np.minimum(np.maximum(share, 0.0), 1.0)[:, None] * self._along
        distances = np.hypot(spots[:, 0] - here[0], spots[:, 1] - here[1])
        nearest = int(distances.argmin())
        return float(distances[nearest]), spots[nearest]

    def settle(self, before: Point, target: Point, radius_m: float) -> Point:
        """The place of a disc that moves from ``before`` to ``wanted``: it slides along walls.

        The move must be short compared with the radius. In a corner too tight to slide out of, it stays.
        """
        place = np.asarray(target, dtype=np.float64)
        for _ in range(PUSHES):
            distance, spot = self._nearest((place[0], place[1]))
            if distance >= radius_m - TOUCH_TOLERANCE_M:
                return float(place[0]), float(place[1])
            if distance == 0:
                return before
            place = spot + (place - spot) * (radius_m / distance)
        return before

    def keep_off(self, before: Point, target: Point, radius_m: float) -> tuple[Point, bool]:
        """The same among discs: its place beside them, and whether it touches one.

        A disc that has moved into it does not push it. It may leave a disc, and comes no closer to it.
        """
        place = target
        gaps = self._gaps_m(place, radius_m)
        for number in np.flatnonzero(gaps < TOUCH_TOLERANCE_M):
            x, y, disc_m = self.discs[number]
            apart_m, before_m = math.dist(place, (x, y)), math.dist(before, (x, y))
            kept_m = min(before_m, radius_m + disc_m)
            if 0 < apart_m < kept_m:
                share = kept_m / apart_m
                place = (float(x + (place[0] - x) * share), float(y + (place[1] - y) * share))
        if place != target and self.settle(before, place, radius_m) != place:
            place = before
        return place, bool((gaps < TOUCH_TOLERANCE_M).any())

    def _gaps_m(self, place: Point, radius_m: float) -> Vector:
        discs = self.discs
        gaps: Vector = np.hypot(discs[:, 0] - place[0], discs[:, 1] - place[1]) - discs[:, 2] - radius_m
        return gaps

    def first_hits_m(self, origin: Point, bearings_rad: Vector) -> Vector:
        """How far a beam runs, per bearing (world frame, CCW from +x), to a wall or disc; inf where it meets none."""
        rays = np.stack((np.cos(bearings_rad), np.sin(bearings_rad)), axis=1)
        to_start = self._start - np.asarray(origin)
        turn = _cross(rays[:, None, :], self._along[None, :, :])
        parallel = turn == 0
        turn[parallel] = 1.0
        reach = _cross(to_start, self._along)[None, :] / turn
        share = _cross(to_start[None, :, :], rays[:, None, :]) / turn
        missed = parallel | (reach < 0) | (share < 0) | (share > 1)
        nearest: Vector = np.where(missed, np.inf, reach).min(axis=1)
        if len(self.discs):
            nearest = np.minimum(nearest, to_discs_m(np.asarray(origin)[None], bearings_rad, self.discs))
        return nearest


def _cross(a: Vector, b: Vector) -> Vector:
    """The z component of the cross products of vectors along the last axis."""
    product: Vector = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product
