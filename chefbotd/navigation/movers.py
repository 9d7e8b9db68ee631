"""Who moves, and how: what is not on the map, grouped into things that are followed from scan to scan."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from chefbotd.navigation.grid_frame import Floats

GAP_M = 0.3
"""Points no farther apart than this, one after the other, are one thing."""

WIDEST_M = 1.2
"""What is wider is a wall or a table: its middle moves with what is seen of it, and says nothing."""

FASTEST_M_S = 2.0
SLOWEST_M_S = 0.18
"""Slower than this is noise."""

OVER_S, AFTER_S = 0.5, 0.35
"""A velocity is measured over so long, and believed after so long: beams that come and go shift a thing's middle."""

FORGOTTEN_S = 0.6


@dataclass(frozen=True, slots=True)
class Mover:
    """A thing: its middle and velocity in the grid's frame, and where it was lately (time, x, y), the oldest first."""

    x_m: float
    y_m: float
    vx_m_s: float
    vy_m_s: float
    stamp_s: float
    was: tuple[tuple[float, float, float], ...]


def followed(movers: tuple[Mover, ...], stamp_s: float, points_m: Floats) -> tuple[tuple[Mover, ...], Floats]:
    """The things of a new scan, and for each of its points (n, 2, in the order of the beams) its velocity."""
    velocities = np.zeros_like(points_m)
    found = list[Mover]()
    left = [mover for mover in movers if stamp_s - mover.stamp_s <= FORGOTTEN_S]
    for span in _things(points_m):
        thing = points_m[span]
        x_m, y_m = (float(value) for value in (thing.min(axis=0) + thing.max(axis=0)) / 2)
        if np.ptp(thing, axis=0).max() > WIDEST_M:
            continue
        mover = _matched(left, stamp_s, x_m, y_m)
        found.append(mover)
        if math.hypot(mover.vx_m_s, mover.vy_m_s) > SLOWEST_M_S:
            velocities[span] = mover.vx_m_s, mover.vy_m_s
    return (*found, *left), velocities


def _things(points_m: Floats) -> list[slice]:
    if not len(points_m):
        return []
    gaps = np.hypot(*np.diff(points_m, axis=0).T) > GAP_M
    ends = [0, *(np.flatnonzero(gaps) + 1).tolist(), len(points_m)]
    return [slice(begin, end) for begin, end in pairwise(ends)]


def _matched(left: list[Mover], stamp_s: float, x_m: float, y_m: float) -> Mover:
    """The thing that was here, or near; it is taken out of ``left``."""
    nearest, best = None, 0.35
    for mover in left:
        dt_s = stamp_s - mover.stamp_s
        ahead_x, ahead_y = mover.x_m + mover.vx_m_s * dt_s, mover.y_m + mover.vy_m_s * dt_s
        away = min(math.hypot(x_m - ahead_x, y_m - ahead_y), math.hypot(x_m - mover.x_m, y_m - mover.y_m))
        if away < best and dt_s > 0:
            nearest, best = mover, away
    here = (stamp_s, x_m, y_m)
    if nearest is None:
        return Mover(x_m, y_m, 0.0, 0.0, stamp_s, (here,))
    left.remove(nearest)
    was = (*(each for each in nearest.was if stamp_s - each[0] <= OVER_S + 1e-6), here)
    began_s, began_x, began_y = was[0]
    over_s = stamp_s - began_s
    vx, vy = (x_m - began_x) / max(over_s, 1e-3), (y_m - began_y) / max(over_s, 1e-3)
    if over_s < AFTER_S or math.hypot(vx, vy) > FASTEST_M_S:
        vx = vy = 0.0
    return Mover(x_m, y_m, vx, vy, stamp_s, was)
