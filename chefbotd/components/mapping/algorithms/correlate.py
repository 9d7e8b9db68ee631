"""Finds the best pose of a scan in a window, from coarse to fine, without missing any.

The score of a pose is the mean likelihood of the scan's points there, less a penalty for its distance from the
guess. A coarse cell bounds the score of all poses within it from above, so whole blocks of poses are excluded at
once (Olson, "Real-Time Correlative Scan Matching", ICRA 2009; with a third level as in Hess et al., "Real-Time
Loop Closure in 2D LIDAR SLAM", ICRA 2016). All kernels count shifts in cells of the finest grid.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.mapping.algorithms.local_map import CELL_M, Bytes, LocalMap
from chefbotd.components.mapping.algorithms.surfaces import Singles
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.poses import Floats, wrap
from chefbotd.core.record import Record, replace

FINEST_TURN_RAD, COARSEST_TURN_RAD = 0.004, 0.03
FAR_SHARE = 0.75
"""The turn between two tries moves the point at this rank of distance by one cell."""

WIDE_M = 0.6
"""From this half width on, a third level pays."""


WITHOUT_LIMIT = 1 << 60
PLACING = 4
"""What it costs to turn all points, in scores."""


class Window(NamedTuple):
    """Where to search: so far around the guess in x and y (m), and in heading (rad).

    ``penalty_per_m2`` and ``penalty_per_rad2`` prefer what is near the guess.
    """

    half_m: float
    half_rad: float
    penalty_per_m2: float = 0.0
    penalty_per_rad2: float = 0.0


class Excluded(NamedTuple):
    """Poses that do not count: this near to (x, y, heading)."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0
    near_m: float = -1.0
    near_rad: float = -1.0


NOTHING_EXCLUDED = Excluded()


class ScoredPose(Record, frozen=True):
    """The best pose, and its score from 0 to 1."""

    pose: Floats
    score: float


class _Search(NamedTuple):
    """What stays the same during a search. ``top`` is the grid of the coarsest level, of 2**shift cells."""

    grids: LocalMap
    top: Bytes
    shift: int
    guess: Floats
    reach: int
    window: Window
    excluded: Excluded


class WindowSearch(Record, frozen=True):
    """A search under way; its arrays are used up by the next step.

    ``blocks`` are the first shifts (x, y) of the blocks that are searched, ``bounds`` those of all blocks at all turns.
    ``at``: bounds computed, blocks divided, and likelihoods looked up; ``best``: x, y, heading, score.
    """

    within: _Search
    points: Singles
    turns: Floats
    blocks: NDArray[np.int64]
    bounds: Floats
    order: NDArray[np.int64]
    best: Floats
    above: float
    at: NDArray[np.int64]
    is_done: bool = False

    @property
    def work(self) -> int:
        """The likelihoods looked up so far."""
        return int(self.at[2])

    @property
    def best_pose(self) -> ScoredPose | None:
        """The best pose so far; None if none scores enough."""
        if self.best[3] <= self.above:
            return None
        return ScoredPose(
            np.array([self.best[0], self.best[1], wrap(self.best[2:3])[0]]), float(self.best[3])
        )


def search(
    grids: LocalMap,
    points: Singles,
    guess: Floats,
    window: Window,
    *,
    above: float = -1e9,
    excluded: Excluded = NOTHING_EXCLUDED,
    points_at_most: int = 90,
) -> ScoredPose | None:
    """The best pose in the window that scores more than ``above``; None if there is none.

    At most so many of ``points`` (n, 2) are taken, evenly spread over the scan.
    """
    if len(points) == 0:
        return None
    whole = start_window_search(grids, points, guess, window, above=above, points_at_most=points_at_most)
    search = replace(whole, within=whole.within._replace(excluded=excluded))
    return advance_window_search(search, WITHOUT_LIMIT).best_pose


def start_window_search(
    grids: LocalMap,
    points: Singles,
    guess: Floats,
    window: Window,
    *,
    above: float = -1e9,
    near: Floats | None = None,
    near_m: float = 0.0,
    points_at_most: int = 90,
    turn_m: float = CELL_M,
) -> WindowSearch:
    """The same search, to be advanced in parts; nothing is computed yet. There must be points (n, 2).

    With ``near`` (m, 2) only blocks of poses within ``near_m`` of one of these places are searched. From one heading to
    the next a far point moves by ``turn_m``.
    """
    shift = 4 if window.half_m >= WIDE_M else 2
    top = _pool_coarse(grids.coarse) if shift == 4 else grids.coarse
    turns = _turns(points, window.half_rad, turn_m)
    reach = math.ceil(window.half_m / CELL_M)
    blocks = _blocks(guess, reach, 1 << shift, near, near_m)
    some = np.ascontiguousarray(points[:: math.ceil(len(points) / points_at_most)])
    count = len(turns) * len(blocks)
    within = _Search(grids, top, shift, guess, reach, window, NOTHING_EXCLUDED)
    best, at = np.array([*guess, above]), np.zeros(3, np.int64)
    return WindowSearch(
        within, some, turns, blocks, np.empty(count), np.empty(count, np.int64), best, above, at
    )


def for_another(search: WindowSearch, above: float, excluded: Excluded) -> WindowSearch:
    """A search for a second pose, once the first is found: the bounds are the same."""
    at = np.array([search.at[0], 0, search.at[2]])
    within, best = search.within._replace(excluded=excluded), np.array([*search.within.guess, above])
    return replace(search, within=within, best=best, above=above, at=at, is_done=False)


def advance_window_search(search: WindowSearch, lookups: int) -> WindowSearch:
    """The search further by about so many likelihoods; in how many parts it goes on changes nothing."""
    if search.is_done:
        return search
    done = _advance(
        search.within, search.points, search.turns, search.blocks, search.bounds, search.order, search.best,
        search.at, search.work + lookups,
    )  # fmt: skip
    return replace(search, is_done=bool(done))


def _blocks(guess: Floats, reach: int, size: int, near: Floats | None, near_m: float) -> NDArray[np.int64]:
    count = (2 * reach) // size + 1
    y, x = np.divmod(np.arange(count * count), count)
    blocks = size * np.column_stack([x, y]).astype(np.int64)
    if near is None:
        return blocks
    middles = guess[:2] + (blocks + (size - 1) / 2 - reach) * CELL_M
    away = np.hypot(*(middles[:, None, :] - near[None, :, :]).transpose(2, 0, 1)).min(axis=1)
    chosen: NDArray[np.int64] = blocks[away <= near_m]
    return chosen


def _turns(points: Singles, half_rad: float, turn_m: float) -> Floats:
    """The turns to try, so that a far point moves by so much from one to the next."""
    squared = np.sort(np.einsum("ij,ij->i", points, points))
    far_m = math.sqrt(squared[int(len(points) * FAR_SHARE)])
    step = min(max(turn_m / max(far_m, CELL_M), FINEST_TURN_RAD), COARSEST_TURN_RAD)
    most = math.ceil(half_rad / step)
    return (np.arange(-most, most + 1) * step).astype(np.float64)


def _pool_coarse(coarse: Bytes) -> Bytes:
    top = np.zeros(((coarse.shape[0] + 3) // 4, (coarse.shape[1] + 3) // 4), np.uint8)
    _pool(coarse, top)
    return top


@kernel
def _pool(coarse: Bytes, top: Bytes) -> None:
    """A cell of 16 fine ones bounds shifts by up to 15, so it covers 7 coarse cells, which bound shifts by 3."""
    for j in range(top.shape[0]):
        for i in range(top.shape[1]):
            most = np.uint8(0)
            for y in range(4 * j, min(4 * j + 7, coarse.shape[0])):
                for x in range(4 * i, min(4 * i + 7, coarse.shape[1])):
                    most = max(most, coarse[y, x])
            top[j, i] = most


@kernel
def _advance(
    within: _Search,
    points: Singles,
    turns: Floats,
    blocks: NDArray[np.int64],
    bounds: Floats,
    order: NDArray[np.int64],
    best: Floats,
    at: NDArray[np.int64],
    until: int,
) -> bool:
    """Bound all blocks, then divide them from the most promising on, until so much work is done; whether all is."""
    size, count, beams = 1 << within.shift, blocks.shape[0], points.shape[0]
    cells = np.empty((beams, 2), np.int64)
    placed = -1
    while at[0] < bounds.shape[0]:
        if at[2] >= until:
            return False
        k = at[0]
        a, b = k // count, k % count
        if a != placed:
            _place(within, points, turns[a], cells)
            placed = a
        x, y = blocks[b, 0], blocks[b, 1]
        bounds[k] = _mean(within.top, cells, x, y, within.shift) - _penalty(within, turns[a], x, y, size)
        at[0] += 1
        at[2] += beams
        if at[0] == bounds.shape[0]:
            order[:] = np.argsort(-bounds)
            at[2] += beams * bounds.shape[0]  # sorting costs about as much as bounding
    while at[1] < bounds.shape[0]:
        k = order[at[1]]
        if bounds[k] <= best[3]:
            return True
        if at[2] >= until:
            return False
        a, b = k // count, k % count
        _place(within, points, turns[a], cells)
        at[2] += beams * (PLACING + _descend(within, cells, turns[a], blocks[b, 0], blocks[b, 1], best))
        at[1] += 1
    return True


@kernel
def _place(within: _Search, points: Singles, turn: float, cells: NDArray[np.int64]) -> None:
    """The cells that the points fall into at the window's lowest x and y."""
    cos, sin = math.cos(within.guess[2] + turn), math.sin(within.guess[2] + turn)
    ox, oy = within.guess[0] - within.grids.origin_m[0], within.guess[1] - within.grids.origin_m[1]
    for i in range(points.shape[0]):
        cells[i, 0] = math.floor((ox + cos * points[i, 0] - sin * points[i, 1]) / CELL_M) - within.reach
        cells[i, 1] = math.floor((oy + sin * points[i, 0] + cos * points[i, 1]) / CELL_M) - within.reach


@kernel
def _mean(grid: Bytes, cells: NDArray[np.int64], x: int, y: int, shift: int) -> float:
    """The mean likelihood of the points, shifted by so many fine cells; outside of the grid it is 0."""
    total, rows, columns = 0, grid.shape[0], grid.shape[1]
    count: int = cells.shape[0]
    for i in range(count):
        column, row = (cells[i, 0] + x) >> shift, (cells[i, 1] + y) >> shift
        if 0 <= column < columns and 0 <= row < rows:
            total += int(grid[row, column])
    return total / (255.0 * count)


@kernel
def _penalty(within: _Search, turn: float, x: int, y: int, size: int) -> float:
    """The least penalty of a block of shifts."""
    low_x, low_y = (x - within.reach) * CELL_M, (y - within.reach) * CELL_M
    more = (size - 1) * CELL_M
    dx, dy = max(low_x, 0.0, -low_x - more), max(low_y, 0.0, -low_y - more)
    squared = dx * dx + dy * dy
    turned = turn * turn
    return within.window.penalty_per_m2 * squared + within.window.penalty_per_rad2 * turned


@kernel
def _descend(within: _Search, cells: NDArray[np.int64], turn: float, x: int, y: int, best: Floats) -> int:
    """Search a block; how many poses and blocks were scored."""
    if within.shift == 2:
        _try(within, cells, turn, x, y, best)
        return 16
    scored = 16
    for block in range(16):
        bx, by = x + 4 * (block % 4), y + 4 * (block // 4)
        bound = _mean(within.grids.coarse, cells, bx, by, 2) - _penalty(within, turn, bx, by, 4)
        if bound > best[3]:
            _try(within, cells, turn, bx, by, best)
            scored += 16
    return scored


@kernel
def _try(within: _Search, cells: NDArray[np.int64], turn: float, x: int, y: int, best: Floats) -> None:
    """Score each pose of a block of 4 by 4."""
    for block in range(16):
        bx, by = x + block % 4, y + block // 4
        if bx > 2 * within.reach or by > 2 * within.reach:
            continue
        px = within.guess[0] + (bx - within.reach) * CELL_M
        py = within.guess[1] + (by - within.reach) * CELL_M
        if _is_excluded(within.excluded, px, py, within.guess[2] + turn):
            continue
        score = _mean(within.grids.likelihood, cells, bx, by, 0) - _penalty(within, turn, bx, by, 1)
        if score > best[3]:
            best[0], best[1], best[2], best[3] = px, py, within.guess[2] + turn, score


@kernel
def _is_excluded(excluded: Excluded, x: float, y: float, heading: float) -> bool:
    turn = heading - excluded.heading_rad
    turn -= 2 * math.pi * math.floor(turn / (2 * math.pi) + 0.5)
    near = math.hypot(x - excluded.x_m, y - excluded.y_m) < excluded.near_m
    return near and abs(turn) < excluded.near_rad
