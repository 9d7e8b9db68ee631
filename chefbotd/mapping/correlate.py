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

from chefbotd.core.compiled import kernel
from chefbotd.mapping.local_map import CELL_M, Bytes, LocalMap
from chefbotd.mapping.poses import Floats, wrap
from chefbotd.mapping.surfaces import Singles

FINEST_TURN_RAD, COARSEST_TURN_RAD = 0.004, 0.03
FAR_SHARE = 0.75
"""The turn between two tries moves the point at this rank of distance by one cell."""

WIDE_M = 0.6
"""From this half width on, a third level pays."""


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


class Found(NamedTuple):
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


def search(
    grids: LocalMap,
    points: Singles,
    guess: Floats,
    window: Window,
    *,
    above: float = -1e9,
    excluded: Excluded = NOTHING_EXCLUDED,
    points_at_most: int = 90,
) -> Found | None:
    """The best pose in the window that scores more than ``above``; None if there is none.

    At most so many of ``points`` (n, 2) are taken, evenly spread over the scan.
    """
    if len(points) == 0:
        return None
    shift = 4 if window.half_m >= WIDE_M else 2
    top = _pooled(grids.coarse) if shift == 4 else grids.coarse
    turns = _turns(points, window.half_rad)
    reach = math.ceil(window.half_m / CELL_M)
    some = np.ascontiguousarray(points[:: math.ceil(len(points) / points_at_most)])
    best = np.array([*guess, above])
    _search(_Search(grids, top, shift, guess, reach, window, excluded), some, turns, best)
    if best[3] <= above:
        return None
    return Found(np.array([best[0], best[1], wrap(best[2:3])[0]]), float(best[3]))


def _turns(points: Singles, half_rad: float) -> Floats:
    """The turns to try, so that a far point moves by one cell from one to the next."""
    squared = np.sort(np.einsum("ij,ij->i", points, points))
    far_m = math.sqrt(squared[int(len(points) * FAR_SHARE)])
    step = min(max(CELL_M / max(far_m, CELL_M), FINEST_TURN_RAD), COARSEST_TURN_RAD)
    most = math.ceil(half_rad / step)
    return (np.arange(-most, most + 1) * step).astype(np.float64)


def _pooled(coarse: Bytes) -> Bytes:
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
def _search(within: _Search, points: Singles, turns: Floats, best: Floats) -> None:
    """Fill ``best`` (x, y, heading, score), block by block from the most promising on."""
    size = 1 << within.shift
    blocks = (2 * within.reach) // size + 1
    cells = np.empty((points.shape[0], 2), np.int64)
    bounds = np.empty(turns.shape[0] * blocks * blocks)
    for a in range(turns.shape[0]):
        _place(within, points, turns[a], cells)
        for b in range(blocks * blocks):
            x, y = size * (b % blocks), size * (b // blocks)
            bound = _mean(within.top, cells, x, y, within.shift) - _penalty(within, turns[a], x, y, size)
            bounds[a * blocks * blocks + b] = bound
    for k in np.argsort(-bounds):
        if bounds[k] <= best[3]:
            return
        a, b = k // (blocks * blocks), k % (blocks * blocks)
        _place(within, points, turns[a], cells)
        _descend(within, cells, turns[a], size * (b % blocks), size * (b // blocks), best)


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
def _descend(within: _Search, cells: NDArray[np.int64], turn: float, x: int, y: int, best: Floats) -> None:
    if within.shift == 2:
        _try(within, cells, turn, x, y, best)
        return
    for block in range(16):
        bx, by = x + 4 * (block % 4), y + 4 * (block // 4)
        bound = _mean(within.grids.coarse, cells, bx, by, 2) - _penalty(within, turn, bx, by, 4)
        if bound > best[3]:
            _try(within, cells, turn, bx, by, best)


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
