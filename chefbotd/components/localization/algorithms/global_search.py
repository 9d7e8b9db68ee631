"""Finds all poses of a map at which a scan fits nearly as well as at the best one, by branch and bound in parts.

The score of a pose is the mean likelihood of the scan's points there, on cells of 10 cm. Blocks of 16 by 16 cells are
bounded from above at each heading; only those that may hold a pose nearly as good as the best are divided (Hess et
al., "Real-Time Loop Closure in 2D LIDAR SLAM", ICRA 2016). So rooms that look alike are all found, and none of them
is missed.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.localization.algorithms.branch_and_bound import BLOCK, CELL_M, Pyramid, bound, divide
from chefbotd.components.mapping.algorithms.correlate import ScoredPose
from chefbotd.components.mapping.algorithms.surfaces import Singles
from chefbotd.core.poses import Floats, wrap
from chefbotd.core.record import Record, replace

FINEST_TURN_RAD, COARSEST_TURN_RAD = 0.01, 0.08
FAR_SHARE = 0.75
"""The turn between two tries moves the point at this rank of distance by one cell."""

THINNED_M = 0.12
"""Points are so far apart at least: near walls, which have many beams, count no more than far ones."""


MIN_SCORE: Final = 0.35
"""What scores less is no match, however alone it stands."""

NEARLY: Final = 0.75
"""All places are found that score this share of the best."""

POINTS_AT_MOST: Final = 80
PLACES_AT_MOST: Final = 24
APART_M: Final = 0.4
APART_RAD: Final = 0.35
"""Two poses that are nearer in both are one place."""

BOUNDS_A_STEP: Final = 30_000
"""How many bounds and scores a step computes: 10 to 20 ms."""


class GlobalSearch(Record, frozen=True):
    """A search under way; the arrays in it are used up by the next step.

    ``bounds`` are those of all blocks at all turns, computed up to ``bounded``; then ``order`` says in which order
    they are divided, as far as ``divided``. ``found`` are rows of x, y, heading, score, the first ``count`` of them
    filled.
    """

    pyramid: Pyramid
    points: Singles
    turns: Floats
    blocks: tuple[int, int]
    bounds: Floats
    bounded: int
    order: NDArray[np.int64]
    divided: int
    found: Floats
    count: int
    best: float
    is_done: bool = False
    is_complete: bool = True

    @property
    def share_done(self) -> float:
        """About how much of it is done, from 0 to 1."""
        bounding = self.bounded / len(self.bounds)
        if not len(self.order):
            return 0.5 * bounding
        return 1.0 if self.is_done else 0.5 + 0.5 * self.divided / len(self.order)


def start_search(pyramid: Pyramid, points: Singles, *, points_at_most: int = POINTS_AT_MOST) -> GlobalSearch:
    """A search for a scan's points (n, 2), in the robot's frame; nothing is computed yet.

    Raises:
        ValueError: there are no points.
    """
    if not len(points):
        raise ValueError("a search needs a scan with points, but this one has none")
    some = thin_points(points, points_at_most)
    rows, columns = pyramid.levels.shape[1:]
    blocks = (math.ceil(columns / BLOCK), math.ceil(rows / BLOCK))
    turns = _turns(some)
    return GlobalSearch(
        pyramid, some, turns, blocks, np.zeros(len(turns) * blocks[0] * blocks[1]), 0,
        np.zeros(0, np.int64), 0, np.zeros((4096, 4)), 0, MIN_SCORE / NEARLY,
    )  # fmt: skip


def thin_points(points: Singles, at_most: int) -> Singles:
    """The first point of each small cell, in the order of the beams, and of these not more than so many."""
    cells = np.floor(points / THINNED_M).astype(np.int64)
    _, first = np.unique(cells[:, 0] * (1 << 32) + cells[:, 1], return_index=True)
    kept = points[np.sort(first)]
    chosen = np.linspace(0, len(kept) - 1, min(len(kept), at_most)).astype(int)
    return np.ascontiguousarray(kept[chosen])


def _turns(points: Singles) -> Floats:
    squared = np.sort(np.einsum("ij,ij->i", points, points))
    far_m = math.sqrt(squared[int(len(points) * FAR_SHARE)])
    step = min(max(CELL_M / max(far_m, CELL_M), FINEST_TURN_RAD), COARSEST_TURN_RAD)
    return (np.arange(math.ceil(math.tau / step)) * (math.tau / math.ceil(math.tau / step))).astype(
        np.float64
    )


def advance_global_search(search: GlobalSearch, *, bounds_a_step: int = BOUNDS_A_STEP) -> GlobalSearch:
    """The search, a bounded bit further."""
    if search.is_done:
        return search
    if search.bounded < len(search.bounds):
        end = min(search.bounded + bounds_a_step, len(search.bounds))
        bound(search.pyramid, search.points, search.turns, search.blocks[0], search.blocks[1],
               search.bounded, end, search.bounds)  # fmt: skip
        return replace(search, bounded=end)
    order = search.order if len(search.order) else np.argsort(-search.bounds, kind="stable")
    state = np.array([search.best, float(search.divided), float(search.count), 0.0])
    divide(search.pyramid, search.points, search.turns, search.blocks[0], search.blocks[1], search.bounds, order,
            NEARLY, bounds_a_step, search.found, state)  # fmt: skip
    return replace(
        search,
        order=order,
        best=float(state[0]),
        divided=int(state[1]),
        count=int(state[2]),
        is_done=state[3] > 0,
        is_complete=state[3] < 2,
    )


def places(search: GlobalSearch, *, at_most: int = PLACES_AT_MOST) -> tuple[tuple[ScoredPose, ...], bool]:
    """The places found, the best first, and whether these are all."""
    rows = search.found[: search.count]
    rows = rows[np.argsort(-rows[:, 3], kind="stable")]
    rows = rows[rows[:, 3] >= NEARLY * search.best]
    kept: list[ScoredPose] = []
    for x, y, heading, score in rows:
        if any(is_same(np.array([x, y, heading]), other.pose) for other in kept):
            continue
        if len(kept) == at_most:
            return tuple(kept), False
        kept.append(ScoredPose(np.array([x, y, wrap(np.array([heading]))[0]]), float(score)))
    return tuple(kept), search.is_complete


def is_same(a: Floats, b: Floats) -> bool:
    """Whether two poses are so near to each other that they are one place."""
    turn = abs(math.remainder(float(a[2] - b[2]), math.tau))
    return math.hypot(a[0] - b[0], a[1] - b[1]) < APART_M and turn < APART_RAD
