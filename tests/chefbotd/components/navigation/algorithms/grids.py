"""Small maps for tests: from drawings, boxes and walls; and oracles that share no code with what they judge."""

import heapq
import math

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.geometry import ORIGIN, Pose2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

MEANING = {".": FREE, "#": OCCUPIED, "?": UNKNOWN}


def drawn(*rows: str, resolution_m: float = 0.05, origin: Pose2D = ORIGIN) -> OccupancyGrid:
    """A map from text, its first line on top: ``.`` free, ``#`` occupied, ``?`` unknown."""
    percent = np.array([[MEANING[cell] for cell in row] for row in reversed(rows)], np.int8)
    return OccupancyGrid(resolution_m, origin, percent)


def rasterised(
    walls: NDArray[np.float64], width_m: float, depth_m: float, resolution_m: float = 0.05
) -> OccupancyGrid:
    """A map of segments (x, y, x, y): each cell that a wall passes through is occupied, the others are free."""
    shape = math.ceil(depth_m / resolution_m), math.ceil(width_m / resolution_m)
    percent = np.full(shape, FREE, np.int8)
    for ax, ay, bx, by in walls:
        count = max(math.ceil(math.hypot(bx - ax, by - ay) / (0.1 * resolution_m)), 1)
        along = np.linspace(0, 1, count + 1)
        column = np.clip((ax + along * (bx - ax)) / resolution_m, 0, shape[1] - 1).astype(int)
        row = np.clip((ay + along * (by - ay)) / resolution_m, 0, shape[0] - 1).astype(int)
        percent[row, column] = OCCUPIED
    return OccupancyGrid(resolution_m, ORIGIN, percent)


def segment_distance_m(walls: NDArray[np.float64], x_m: float, y_m: float) -> float:
    """How far a point is from the nearest wall."""
    ax, ay, bx, by = walls.T
    ex, ey = bx - ax, by - ay
    share = np.clip(((x_m - ax) * ex + (y_m - ay) * ey) / (ex * ex + ey * ey), 0, 1)
    return float(np.hypot(x_m - ax - share * ex, y_m - ay - share * ey).min())


def dijkstra(costs: NDArray[np.float32], start: tuple[int, int], goal: tuple[int, int]) -> float:
    """The least cost by the rules that ``search`` states, found in the plainest way."""
    best, queue = {start: 0.0}, [(0.0, start)]
    while queue:
        cost, (row, column) = heapq.heappop(queue)
        if (row, column) == goal:
            return cost
        if cost > best[row, column]:
            continue
        for down in (-1, 0, 1):
            for across in (-1, 0, 1):
                there = row + down, column + across
                if (down, across) == (0, 0) or not _is_free(costs, *there):
                    continue
                beside = _is_free(costs, row + down, column) and _is_free(costs, row, column + across)
                if down and across and not beside:
                    continue
                total = cost + math.hypot(down, across) * (costs[row, column] + costs[there]) / 2
                if total < best.get(there, math.inf):
                    best[there] = total
                    heapq.heappush(queue, (total, there))
    return math.inf


def _is_free(costs: NDArray[np.float32], row: int, column: int) -> bool:
    rows, columns = costs.shape
    return 0 <= row < rows and 0 <= column < columns and bool(np.isfinite(costs[row, column]))
