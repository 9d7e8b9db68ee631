"""``world.find_nearest``, compiled: the same sums in the same order, so the same bits. It needs numba."""

import numpy as np

from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.world import ALONG_A_WALL, NOTHING, Nearest
from chefbotd.components.worker.compiled import kernel


@kernel
def find_nearest(walls: Vector, origins: Vector, cos: Vector, sin: Vector) -> Nearest:
    """What beams meet first of walls (5 x S: x1, y1, x2 - x1, y2 - y1, length)."""
    beams = origins.shape[0]
    range_m, column, square = np.full(beams, np.inf), np.full(beams, NOTHING), np.ones(beams)
    for i in range(beams):
        for k in range(walls.shape[1]):
            along_x, along_y = walls[2, k], walls[3, k]
            x, y = walls[0, k] - origins[i, 0], walls[1, k] - origins[i, 1]
            turn = cos[i] * along_y - sin[i] * along_x + ALONG_A_WALL
            reach_m = (x * along_y - y * along_x) / turn
            share = (x * sin[i] - y * cos[i]) / turn
            if reach_m < 0 or abs(share - 0.5) > 0.5 or reach_m >= range_m[i]:
                continue
            range_m[i], column[i], square[i] = reach_m, k, abs(turn) / walls[4, k]
    return range_m, column, square
