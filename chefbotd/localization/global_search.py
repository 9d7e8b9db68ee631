"""All poses of a map at which a scan fits nearly as well as at the best one: branch and bound, a bounded bit at a time.

The score of a pose is the mean likelihood of the scan's points there, on cells of 10 cm. Blocks of 16 by 16 cells are
bounded from above at each heading; only those that may hold a pose nearly as good as the best are divided (Hess et
al., "Real-Time Loop Closure in 2D LIDAR SLAM", ICRA 2016). So rooms that look alike are all found, and none of them
is missed.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from chefbotd.core.compiled import kernel
from chefbotd.core.parameters import Parameters
from chefbotd.localization.pyramid import BLOCK, CELL_M, LEVELS, Pyramid
from chefbotd.mapping.local_map import Bytes
from chefbotd.mapping.poses import Floats, wrap
from chefbotd.mapping.surfaces import Singles

FINEST_TURN_RAD, COARSEST_TURN_RAD = 0.01, 0.08
FAR_SHARE = 0.75
"""The turn between two tries moves the point at this rank of distance by one cell."""

THINNED_M = 0.12
"""Points are so far apart at least: near walls, which have many beams, count no more than far ones."""


class GlobalSearchParameters(Parameters):
    """What is looked for, and how much work a step is."""

    least_score: float = Field(default=0.35, gt=0, le=1)
    """What scores less is no match, however alone it stands."""
    nearly: float = Field(default=0.75, gt=0, lt=1)
    """All places are found that score this share of the best."""
    points_at_most: int = Field(default=80, ge=10, le=1000)
    places_at_most: int = Field(default=24, ge=2, le=200)
    apart_m: float = Field(default=0.4, gt=0, le=5)
    apart_rad: float = Field(default=0.35, gt=0, le=3)
    """Two poses that are nearer in both are one place."""
    bounds_a_step: int = Field(default=30_000, ge=100, le=10_000_000)
    """How many bounds and scores a step computes: 10 to 20 ms."""


class Place(NamedTuple):
    """A pose, and its score from 0 to 1."""

    pose: Floats
    score: float


@dataclass(frozen=True, slots=True)
class GlobalSearch:
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


def begun(params: GlobalSearchParameters, within: Pyramid, points: Singles) -> GlobalSearch:
    """A search for a scan's points (n, 2), in the robot's frame; nothing is computed yet.

    Raises:
        ValueError: there are no points.
    """
    if not len(points):
        raise ValueError("a search needs a scan with points, but this one has none")
    some = thinned(points, params.points_at_most)
    rows, columns = within.levels.shape[1:]
    blocks = (math.ceil(columns / BLOCK), math.ceil(rows / BLOCK))
    turns = _turns(some)
    return GlobalSearch(
        within, some, turns, blocks, np.zeros(len(turns) * blocks[0] * blocks[1]), 0,
        np.zeros(0, np.int64), 0, np.zeros((4096, 4)), 0, params.least_score / params.nearly,
    )  # fmt: skip


def thinned(points: Singles, at_most: int) -> Singles:
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


def searched(params: GlobalSearchParameters, search: GlobalSearch) -> GlobalSearch:
    """The search, a bounded bit further."""
    if search.is_done:
        return search
    if search.bounded < len(search.bounds):
        end = min(search.bounded + params.bounds_a_step, len(search.bounds))
        _bound(search.pyramid, search.points, search.turns, search.blocks[0], search.blocks[1],
               search.bounded, end, search.bounds)  # fmt: skip
        return _changed(search, bounded=end)
    order = search.order if len(search.order) else np.argsort(-search.bounds, kind="stable")
    state = np.array([search.best, float(search.divided), float(search.count), 0.0])
    _divide(search.pyramid, search.points, search.turns, search.blocks[0], search.blocks[1], search.bounds, order,
            params.nearly, params.bounds_a_step, search.found, state)  # fmt: skip
    return _changed(
        search,
        order=order,
        best=float(state[0]),
        divided=int(state[1]),
        count=int(state[2]),
        is_done=state[3] > 0,
        is_complete=state[3] < 2,
    )


def _changed(search: GlobalSearch, **changes: object) -> GlobalSearch:
    values = {name: getattr(search, name) for name in GlobalSearch.__slots__}
    return GlobalSearch(**{**values, **changes})


def places(params: GlobalSearchParameters, search: GlobalSearch) -> tuple[tuple[Place, ...], bool]:
    """The places found, the best first, and whether these are all."""
    rows = search.found[: search.count]
    rows = rows[np.argsort(-rows[:, 3], kind="stable")]
    rows = rows[rows[:, 3] >= params.nearly * search.best]
    kept: list[Place] = []
    for x, y, heading, score in rows:
        if any(is_same(params, np.array([x, y, heading]), other.pose) for other in kept):
            continue
        if len(kept) == params.places_at_most:
            return tuple(kept), False
        kept.append(Place(np.array([x, y, wrap(np.array([heading]))[0]]), float(score)))
    return tuple(kept), search.is_complete


def is_same(params: GlobalSearchParameters, a: Floats, b: Floats) -> bool:
    """Whether two poses are so near to each other that they are one place."""
    turn = abs(math.remainder(float(a[2] - b[2]), math.tau))
    return math.hypot(a[0] - b[0], a[1] - b[1]) < params.apart_m and turn < params.apart_rad


@kernel
def _place(within: Pyramid, points: Singles, heading: float, cells: NDArray[np.int64]) -> None:
    """The cells that the points fall into from the middle of the first cell."""
    cos, sin = math.cos(heading), math.sin(heading)
    for i in range(points.shape[0]):
        cells[i, 0] = math.floor((cos * points[i, 0] - sin * points[i, 1]) / CELL_M + 0.5)
        cells[i, 1] = math.floor((sin * points[i, 0] + cos * points[i, 1]) / CELL_M + 0.5)


@kernel
def _mean(level: Bytes, cells: NDArray[np.int64], x: int, y: int) -> float:
    total, rows, columns = 0, level.shape[0], level.shape[1]
    count: int = cells.shape[0]
    for i in range(count):
        column, row = cells[i, 0] + x, cells[i, 1] + y
        # A window that begins before the grid may reach into it: the padding is wider than any window.
        if 0 <= column < columns and 0 <= row < rows:
            total += int(level[row, column])
    return total / (255.0 * count)


@kernel
def _bound(
    within: Pyramid,
    points: Singles,
    turns: Floats,
    across: int,
    up: int,
    begin: int,
    end: int,
    bounds: Floats,
) -> None:
    """Bound the blocks from number ``begin`` to ``end``; a block in which no cell is free scores nothing."""
    cells = np.empty((points.shape[0], 2), np.int64)
    placed = -1
    for k in range(begin, end):
        turn, block = k // (across * up), k % (across * up)
        if turn != placed:
            _place(within, points, turns[turn], cells)
            placed = turn
        x, y = BLOCK * (block % across), BLOCK * (block // across)
        bounds[k] = -1.0
        if within.is_free[LEVELS, y, x] > 0:
            bounds[k] = _mean(within.levels[LEVELS], cells, x, y)


@kernel
def _divide(
    within: Pyramid,
    points: Singles,
    turns: Floats,
    across: int,
    up: int,
    bounds: Floats,
    order: NDArray[np.int64],
    nearly: float,
    budget: int,
    found: Floats,
    state: Floats,
) -> None:
    """Divide blocks in their order until none is left that counts, or the budget is used up.

    ``state`` is the best score, how many blocks are divided, how many poses are found, and 1 when done (2: no room
    for all).
    """
    cells = np.empty((points.shape[0], 2), np.int64)
    best_leaf, used = np.empty(3), np.zeros(1, np.int64)
    while int(state[1]) < order.shape[0]:
        k = order[int(state[1])]
        if bounds[k] < nearly * state[0]:
            state[3] = max(state[3], 1.0)
            return
        if used[0] >= budget:
            return
        turn, block = k // (across * up), k % (across * up)
        _place(within, points, turns[turn], cells)
        best_leaf[2] = nearly * state[0]
        x, y = BLOCK * (block % across), BLOCK * (block // across)
        _descend(within, cells, x, y, best_leaf, used)
        state[1] += 1
        if best_leaf[2] <= nearly * state[0]:
            continue
        state[0] = max(state[0], best_leaf[2])
        if int(state[2]) == found.shape[0] and not _emptied(found, state, nearly):
            state[3] = 2.0
            return
        row = int(state[2])
        found[row, 0] = within.origin_m[0] + (best_leaf[0] + 0.5) * CELL_M
        found[row, 1] = within.origin_m[1] + (best_leaf[1] + 0.5) * CELL_M
        found[row, 2], found[row, 3] = turns[turn], best_leaf[2]
        state[2] += 1
    state[3] = max(state[3], 1.0)


@kernel
def _emptied(found: Floats, state: Floats, nearly: float) -> bool:
    """Drop what no longer counts; whether that made room."""
    kept = 0
    for row in range(int(state[2])):
        if found[row, 3] >= nearly * state[0]:
            found[kept, :] = found[row, :]
            kept += 1
    state[2] = kept
    return bool(kept < found.shape[0])


@kernel
def _descend(
    within: Pyramid, cells: NDArray[np.int64], x: int, y: int, best: Floats, used: NDArray[np.int64]
) -> None:
    """The best pose of a block, depth first; ``best`` (x, y, score) begins with the score to be above."""
    stack = np.empty((4 * LEVELS + 4, 3), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2] = LEVELS, x, y
    size = 1
    while size > 0:
        size -= 1
        level, bx, by = stack[size, 0], stack[size, 1], stack[size, 2]
        if by >= within.is_free.shape[1] or bx >= within.is_free.shape[2]:
            continue
        if within.is_free[level, by, bx] == 0:
            continue
        score = _mean(within.levels[level], cells, bx, by)
        used[0] += 1
        if score <= best[2]:
            continue
        if level == 0:
            best[0], best[1], best[2] = bx, by, score
            continue
        half = 1 << (level - 1)
        for part in range(4):
            stack[size, 0] = level - 1
            stack[size, 1], stack[size, 2] = bx + half * (part % 2), by + half * (part // 2)
            size += 1
