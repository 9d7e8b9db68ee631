"""The levels of a map for the global search, and its compiled part: bounds blocks of poses, and divides the promising.

Poses are counted in cells of the pyramid; a block at level h is 2**h by 2**h of them, at one heading.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.localization.algorithms.surface_map import SurfaceMap
from chefbotd.components.mapping.algorithms.local_map import Bytes
from chefbotd.components.mapping.algorithms.surfaces import Singles
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.poses import Floats

CELL_M = 0.1
LEVELS = 4
BLOCK = 1 << LEVELS
SMEAR_M = 0.12
REACH = 3


class Pyramid(NamedTuple):
    """Likelihoods on cells of 10 cm; ``levels[h, y, x]`` is the largest of the 2**h by 2**h cells from (x, y) on.

    ``is_free`` says in the same way whether the robot may stand anywhere there. All are padded by a block.
    """

    origin_m: Floats
    levels: NDArray[np.uint8]
    is_free: NDArray[np.uint8]


def pyramid(of: SurfaceMap) -> Pyramid:
    """The levels for a map; they are made once."""
    both = np.vstack([of.surfaces.points, of.free]).astype(np.float64)
    origin_m = both.min(axis=0) - (BLOCK + REACH) * CELL_M
    size = np.ceil((both.max(axis=0) - origin_m) / CELL_M).astype(int) + BLOCK + REACH
    likelihood = np.zeros((size[1], size[0]), np.uint8)
    _smear_likelihood(likelihood, of.surfaces.points - origin_m)
    free = np.zeros_like(likelihood)
    columns, rows = np.floor((of.free - origin_m) / CELL_M).astype(int).T
    free[rows, columns] = 1
    return Pyramid(origin_m, _pool_levels(likelihood), _pool_levels(free))


def _pool_levels(fine: Bytes) -> NDArray[np.uint8]:
    """Each level from the one below: the larger of four."""
    levels = [fine]
    for h in range(LEVELS):
        below, step = levels[-1], 1 << h
        padded = np.pad(below, ((0, step), (0, step)))
        rows = np.maximum(padded[:-step], padded[step:])
        levels.append(np.maximum(rows[:, :-step], rows[:, step:]))
    return np.stack(levels)


@kernel
def _smear_likelihood(likelihood: Bytes, points: Floats) -> None:
    for i in range(points.shape[0]):
        column, row = int(points[i, 0] / CELL_M), int(points[i, 1] / CELL_M)
        for y in range(row - REACH, row + REACH + 1):
            for x in range(column - REACH, column + REACH + 1):
                dx, dy = (x + 0.5) * CELL_M - points[i, 0], (y + 0.5) * CELL_M - points[i, 1]
                value = 255.0 * math.exp(-(dx * dx + dy * dy) / (2 * SMEAR_M * SMEAR_M))
                likelihood[y, x] = max(likelihood[y, x], np.uint8(value))


@kernel
def place(pyramid: Pyramid, points: Singles, heading: float, cells: NDArray[np.int64]) -> None:
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
def bound(
    pyramid: Pyramid,
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
            place(pyramid, points, turns[turn], cells)
            placed = turn
        x, y = BLOCK * (block % across), BLOCK * (block // across)
        bounds[k] = -1.0
        if pyramid.is_free[LEVELS, y, x] > 0:
            bounds[k] = _mean(pyramid.levels[LEVELS], cells, x, y)


@kernel
def divide(
    pyramid: Pyramid,
    points: Singles,
    turns: Floats,
    across: int,
    up: int,
    bounds: Floats,
    order: NDArray[np.int64],
    nearly: float,
    budget: int,
    poses: Floats,
    state: Floats,
) -> None:
    """Divide blocks in their order until none is left that counts, or the budget is used up.

    ``state``: the best score, blocks divided, poses found, and 1 when done (2: there was no room for all).
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
        place(pyramid, points, turns[turn], cells)
        best_leaf[2] = nearly * state[0]
        x, y = BLOCK * (block % across), BLOCK * (block // across)
        _descend(pyramid, cells, x, y, best_leaf, used)
        state[1] += 1
        if best_leaf[2] <= nearly * state[0]:
            continue
        state[0] = max(state[0], best_leaf[2])
        if int(state[2]) == poses.shape[0] and not _drop_hopeless(poses, state, nearly):
            state[3] = 2.0
            return
        _keep(pyramid, best_leaf, turns[turn], poses, state)
    state[3] = max(state[3], 1.0)


@kernel
def _keep(pyramid: Pyramid, leaf: Floats, turn_rad: float, poses: Floats, state: Floats) -> None:
    """Add the pose in the middle of a cell (x, y, score) to those that are found."""
    row = int(state[2])
    poses[row, 0] = pyramid.origin_m[0] + (leaf[0] + 0.5) * CELL_M
    poses[row, 1] = pyramid.origin_m[1] + (leaf[1] + 0.5) * CELL_M
    poses[row, 2], poses[row, 3] = turn_rad, leaf[2]
    state[2] += 1


@kernel
def _drop_hopeless(poses: Floats, state: Floats, nearly: float) -> bool:
    """Drop what no longer counts; whether that made room."""
    kept = 0
    for row in range(int(state[2])):
        if poses[row, 3] >= nearly * state[0]:
            poses[kept, :] = poses[row, :]
            kept += 1
    state[2] = kept
    return bool(kept < poses.shape[0])


@kernel
def _descend(
    pyramid: Pyramid, cells: NDArray[np.int64], x: int, y: int, best: Floats, used: NDArray[np.int64]
) -> None:
    """The best pose of a block, depth first; ``best`` (x, y, score) begins with the score to be above."""
    stack = np.empty((4 * LEVELS + 4, 3), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2] = LEVELS, x, y
    size = 1
    while size > 0:
        size -= 1
        level, bx, by = stack[size, 0], stack[size, 1], stack[size, 2]
        if by >= pyramid.is_free.shape[1] or bx >= pyramid.is_free.shape[2]:
            continue
        if pyramid.is_free[level, by, bx] == 0:
            continue
        score = _mean(pyramid.levels[level], cells, bx, by)
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
