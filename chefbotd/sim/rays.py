"""Intersects many beams with walls and discs at once, each with its own origin.

Within a hundredth of a second a lidar looks into a small sector, in which few of a building's walls lie. For origins
near a place of reference, each wall's span of bearings is computed once, and widened by the robot's possible motion.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from chefbotd.sim.arrays import Vector

REFERENCE_M = 0.3
"""How far from the place of reference the spans still hold."""

NOTHING = -1
FLIP = np.array([1.0, -1.0])


class Hits(NamedTuple):
    """For each beam its length (inf: it meets nothing), what it meets (``NOTHING``: a disc), and at which angle.

    ``square`` is the cosine between the beam and the normal of the face: 1 head-on, 0 grazing.
    """

    range_m: Vector
    edge: npt.NDArray[np.intp]
    square: Vector


class RayCaster:
    """Beams against the same walls (S x 4: x1, y1, x2, y2) for as long as the place of reference is near."""

    def __init__(self, edges: Vector, reach_m: float) -> None:
        self._start, self._along = edges[:, :2], edges[:, 2:] - edges[:, :2]
        self._length = np.hypot(self._along[:, 0], self._along[:, 1])
        self._reach_m = reach_m
        self._reference = np.array([math.inf, math.inf])
        self._near = self._middle = self._half = np.zeros(0)
        self._number = np.zeros(0, np.intp)

    def cast(self, origins: Vector, bearings_rad: Vector) -> Hits:
        """Where beams end that leave from ``origins`` (B x 2) at rising or falling bearings of the world frame."""
        rays = np.empty((len(bearings_rad), 2))
        rays[:, 0], rays[:, 1] = np.cos(bearings_rad), np.sin(bearings_rad)
        count, chosen = len(bearings_rad), self._in_sight(origins, bearings_rad)
        if not len(chosen):
            return Hits(np.full(count, np.inf), np.full(count, NOTHING), np.ones(count))
        start, along = self._start[chosen], self._along[chosen]
        across = (along[:, ::-1] * FLIP).T
        turn = rays @ across
        turn[turn == 0] = 1e-300
        wall_from_origin = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) - origins @ across
        reach = wall_from_origin / turn
        side = rays[:, ::-1] * FLIP
        offset = (origins * side).sum(axis=1)[:, None]
        share = (side @ start.T - offset) / turn
        missed = reach < 0
        missed |= np.abs(share - 0.5) > 0.5
        reach[missed] = np.inf
        nearest, beams = reach.argmin(axis=1), np.arange(count)
        range_m = reach[beams, nearest]
        square = np.abs(turn[beams, nearest]) / self._length[chosen[nearest]]
        return Hits(range_m, np.where(np.isfinite(range_m), chosen[nearest], NOTHING), square)

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
