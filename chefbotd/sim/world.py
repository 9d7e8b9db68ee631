"""Walls and discs in the plane, which stop a round robot and a beam."""

import math
from collections.abc import Iterable
from typing import TypeAlias

import numpy as np

from chefbotd.sim.arrays import Vector
from chefbotd.sim.crowd import Crowd
from chefbotd.sim.rays import to_discs_m

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

    def settle(self, before: Point, wanted: Point, radius_m: float) -> Point:
        """The place of a disc that moves from ``before`` to ``wanted``: it slides along walls.

        The move must be short compared with the radius. In a corner too tight to slide out of, it stays.
        """
        place = np.asarray(wanted, dtype=np.float64)
        for _ in range(PUSHES):
            distance, spot = self._nearest((place[0], place[1]))
            if distance >= radius_m - TOUCH_TOLERANCE_M:
                return float(place[0]), float(place[1])
            if distance == 0:
                return before
            place = spot + (place - spot) * (radius_m / distance)
        return before

    def keep_off(self, before: Point, wanted: Point, radius_m: float) -> tuple[Point, bool]:
        """The same among discs: its place beside them, and whether it touches one.

        A disc that has moved into it does not push it. It may leave a disc, and comes no closer to it.
        """
        place = wanted
        gaps = self._gaps_m(place, radius_m)
        for number in np.flatnonzero(gaps < TOUCH_TOLERANCE_M):
            x, y, disc_m = self.discs[number]
            apart_m, before_m = math.dist(place, (x, y)), math.dist(before, (x, y))
            kept_m = min(before_m, radius_m + disc_m)
            if 0 < apart_m < kept_m:
                share = kept_m / apart_m
                place = (float(x + (place[0] - x) * share), float(y + (place[1] - y) * share))
        if place != wanted and self.settle(before, place, radius_m) != place:
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
