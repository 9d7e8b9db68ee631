"""A map's likelihoods in levels, each an upper bound of the one below, which makes a global search fast."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.compiled import kernel
from chefbotd.localization.surface_map import SurfaceMap
from chefbotd.mapping.local_map import Bytes
from chefbotd.mapping.poses import Floats

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
    _smeared(likelihood, of.surfaces.points - origin_m)
    free = np.zeros_like(likelihood)
    columns, rows = np.floor((of.free - origin_m) / CELL_M).astype(int).T
    free[rows, columns] = 1
    return Pyramid(origin_m, _pooled(likelihood), _pooled(free))


def _pooled(fine: Bytes) -> NDArray[np.uint8]:
    """Each level from the one below: the larger of four."""
    levels = [fine]
    for h in range(LEVELS):
        below, step = levels[-1], 1 << h
        padded = np.pad(below, ((0, step), (0, step)))
        rows = np.maximum(padded[:-step], padded[step:])
        levels.append(np.maximum(rows[:, :-step], rows[:, step:]))
    return np.stack(levels)


@kernel
def _smeared(likelihood: Bytes, points: Floats) -> None:
    for i in range(points.shape[0]):
        column, row = int(points[i, 0] / CELL_M), int(points[i, 1] / CELL_M)
        for y in range(row - REACH, row + REACH + 1):
            for x in range(column - REACH, column + REACH + 1):
                dx, dy = (x + 0.5) * CELL_M - points[i, 0], (y + 0.5) * CELL_M - points[i, 1]
                value = 255.0 * math.exp(-(dx * dx + dy * dy) / (2 * SMEAR_M * SMEAR_M))
                likelihood[y, x] = max(likelihood[y, x], np.uint8(value))
