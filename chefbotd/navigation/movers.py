"""Detects and tracks moving objects: points that are not on the map, grouped and followed from scan to scan."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.record import Record, replace
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

FORGOTTEN_S, WALKER_FORGOTTEN_S = 0.6, 1.5
"""Who was not seen for so long is somebody else; a board that is silent for a second makes nobody a stranger."""

WALKED_M, WALKER_S = 0.5, 10.0
"""What went so far from where it was first seen walks, and for so long after its last step it will walk on: somebody
who lets the robot pass. What is seen of a chair shifts by less while the robot drives past."""


LEARNT = 0.02
"""So much of the usual speed is the present one, at each scan."""


class Mover(Record, frozen=True):
    """A thing: its middle and velocity in the grid's frame, and where it was lately (time, x, y), the oldest first.

    ``from_m`` is where it was first seen, or last stood for long; ``walked_s`` when it walked last; ``radius_m`` is half
    of what is seen of it.
    """

    x_m: float
    y_m: float
    vx_m_s: float
    vy_m_s: float
    stamp_s: float
    was: tuple[tuple[float, float, float], ...]
    from_m: tuple[float, float]
    walked_s: float = -math.inf
    radius_m: float = 0.0
    walks_m_s: tuple[float, float] = (0.0, 0.0)
    """Where it walked last, as fast as it usually does: who comes up to the robot is slowed down by it."""

    @property
    def is_walker(self) -> bool:
        """Whether it walks, or stands only for a while."""
        return self.stamp_s - self.walked_s < WALKER_S


class Followed(Record, frozen=True):
    """The things of a scan; for each of its points its velocity and how it will move soon (n, 2), and who walks (n)."""

    movers: tuple[Mover, ...]
    velocity_m_s: Floats
    intent_m_s: Floats
    is_walker: NDArray[np.bool_]


def followed(movers: tuple[Mover, ...], stamp_s: float, points_m: Floats) -> Followed:
    """The things of a new scan, of its points (n, 2) in the order of the beams."""
    velocities, walkers = np.zeros_like(points_m), np.zeros(len(points_m), np.bool_)
    intents = np.zeros_like(points_m)
    found = list[Mover]()
    left = [mover for mover in movers if stamp_s - mover.stamp_s <= _forgotten_s(mover)]
    for span in _things(points_m):
        thing = points_m[span]
        widest_m = float(np.ptp(thing, axis=0).max())
        if widest_m > WIDEST_M:
            continue
        x_m, y_m = (float(value) for value in (thing.min(axis=0) + thing.max(axis=0)) / 2)
        mover = _matched(left, stamp_s, x_m, y_m, widest_m / 2)
        found.append(mover)
        walkers[span] = mover.is_walker
        if math.hypot(mover.vx_m_s, mover.vy_m_s) > SLOWEST_M_S:
            velocities[span] = intents[span] = mover.vx_m_s, mover.vy_m_s
        if mover.is_walker:
            intents[span] = mover.walks_m_s
    return Followed((*found, *left), velocities, intents, walkers)


def displaced(movers: tuple[Mover, ...]) -> tuple[Mover, ...]:
    """The same after the robot's pose has jumped: how they moved is known from before, and not measured across it."""
    return tuple(replace(mover, was=()) for mover in movers)


def _forgotten_s(mover: Mover) -> float:
    return WALKER_FORGOTTEN_S if mover.is_walker else FORGOTTEN_S


def _things(points_m: Floats) -> list[slice]:
    if not len(points_m):
        return []
    gaps = np.hypot(*np.diff(points_m, axis=0).T) > GAP_M
    ends = [0, *(np.flatnonzero(gaps) + 1).tolist(), len(points_m)]
    return [slice(begin, end) for begin, end in pairwise(ends)]


def _matched(left: list[Mover], stamp_s: float, x_m: float, y_m: float, radius_m: float) -> Mover:
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
        return Mover(x_m, y_m, 0.0, 0.0, stamp_s, (here,), (x_m, y_m), radius_m=radius_m)
    left.remove(nearest)
    was = (*(each for each in nearest.was if stamp_s - each[0] <= OVER_S + 1e-6), here)
    began_s, began_x, began_y = was[0]
    over_s = stamp_s - began_s
    vx, vy = (x_m - began_x) / max(over_s, 1e-3), (y_m - began_y) / max(over_s, 1e-3)
    if over_s < AFTER_S or math.hypot(vx, vy) > FASTEST_M_S:  # not measured: who walked walks on
        vx, vy = (nearest.vx_m_s, nearest.vy_m_s) if nearest.is_walker else (0.0, 0.0)
    radius_m = max(radius_m, 0.9 * nearest.radius_m)  # half of somebody may be hidden for a moment
    mover = Mover(
        x_m, y_m, vx, vy, stamp_s, was, nearest.from_m, nearest.walked_s, radius_m, nearest.walks_m_s
    )
    return _walking(mover)


def _walking(mover: Mover) -> Mover:
    """The same, with when it walked last; what stood for long begins anew."""
    is_going = math.hypot(mover.vx_m_s, mover.vy_m_s) > SLOWEST_M_S
    is_far = math.dist((mover.x_m, mover.y_m), mover.from_m) > WALKED_M
    if is_going and (is_far or mover.is_walker):
        speed_m_s = math.hypot(mover.vx_m_s, mover.vy_m_s)
        usual_m_s = math.hypot(*mover.walks_m_s) or speed_m_s
        usual = (1 - LEARNT) * usual_m_s / speed_m_s + LEARNT
        return replace(mover, walked_s=mover.stamp_s, walks_m_s=(usual * mover.vx_m_s, usual * mover.vy_m_s))
    if mover.walked_s > -math.inf and not mover.is_walker:
        return replace(mover, walked_s=-math.inf, from_m=(mover.x_m, mover.y_m))
    return mover
