"""Finds the cheapest path over a grid: A*, with moves to the eight neighbours.

The open list is a ring of buckets, each as wide as half a step, in which no order is kept: adding and taking cost the
same however many there are. What was taken too early is taken again when it is reached at less cost, and the search goes
on until no bucket can hold anything cheaper than the goal, so the result is exactly optimal all the same.

A*: Hart, Nilsson and Raphael, 1968. Buckets: Dial, 1969; untidy ones: Yatziv et al., 2006.
"""

import math

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.navigation.algorithms.grid import Flags, Floats, Singles
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.record import Record

Integers = NDArray[np.int64]
BLOCKED = np.float32(np.inf)
SQRT_2 = math.sqrt(2.0)
BUCKET_CELLS = 0.5
PER_CELL = 1 / BUCKET_CELLS


class GridPath(Record, frozen=True):
    """Cells (n, 2: row, column) from start to goal, and what they cost: lengths in cells times their costs."""

    cells: Integers
    cost: float


class SearchGrid(Record, frozen=True):
    """Costs prepared for any number of searches: the rectangle of all free cells, row after row in a blocked border.

    ``top`` and ``left`` are the rectangle's first row and column, ``columns`` counts the border's too, and no free cell
    costs more than ``dearest``.
    """

    costs: Singles
    columns: int
    top: int
    left: int
    dearest: float

    def find_path(self, start: tuple[int, int], goal: tuple[int, int]) -> GridPath | None:
        """The cheapest path between two cells (row, column); None when there is none."""
        first, last = self._index(start), self._index(goal)
        if first is None or last is None:
            return None
        parents = np.empty(self.costs.size, np.int32)
        cost = _search(self.costs, self.columns, self.dearest, first, last, parents)
        if math.isinf(cost):
            return None
        cells = _follow_parents(parents, first, last)
        rows, columns = cells // self.columns - 1 + self.top, cells % self.columns - 1 + self.left
        return GridPath(np.stack([rows, columns], axis=1), cost)

    def _index(self, cell: tuple[int, int]) -> int | None:
        """Where a cell is in ``costs``; None where it is blocked."""
        row, column = cell[0] - self.top + 1, cell[1] - self.left + 1
        if not (0 < row < self.costs.size // self.columns and 0 < column < self.columns):
            return None
        index = row * self.columns + column
        return None if math.isinf(self.costs[index]) else index


def search(costs: Singles, start: tuple[int, int], goal: tuple[int, int]) -> GridPath | None:
    """The cheapest path between two cells (row, column); None when there is none.

    A free cell costs 1 or more, a blocked one is infinite. A step costs its length (1, or sqrt 2 for a diagonal)
    times the mean of both cells. A diagonal step needs both cells beside it free.
    """
    return prepare_costs(costs).find_path(start, goal)


def prepare_costs(costs: Singles) -> SearchGrid:
    """Costs as ``search`` takes them, for more than one search."""
    free = costs < BLOCKED
    rows, columns = _extent(free), _extent(free.T)
    part = costs[rows, columns]
    bits = (costs.view(np.int32) * free).max(initial=0)  # positive floats are ordered as their bits are
    dearest = float(np.int32(bits).view(np.float32))
    bordered = np.pad(part, 1, constant_values=BLOCKED)  # so that a search need not look where the grid ends
    return SearchGrid(bordered.reshape(-1), bordered.shape[1], rows.start, columns.start, max(dearest, 1.0))


def _extent(flags: Flags) -> slice:
    """From the first to the last row with any that is set."""
    indices = np.flatnonzero(flags.any(axis=1))
    return slice(int(indices[0]), int(indices[-1]) + 1) if len(indices) else slice(0, 0)


@kernel
def _follow_parents(parents: NDArray[np.int32], first: int, last: int) -> Integers:
    count, cell = 1, last
    while cell != first:
        cell = parents[cell]
        count += 1
    cells, cell = np.empty(count, np.int64), last
    for i in range(count - 1, -1, -1):
        cells[i] = cell
        cell = parents[cell]
    return cells


@kernel
def _octile(dx: int, dy: int) -> float:
    dx, dy = abs(dx), abs(dy)
    return max(dx, dy) + (SQRT_2 - 1.0) * min(dx, dy)


@kernel
def _search(
    costs: Singles, columns: int, dearest: float, first: int, last: int, parents: NDArray[np.int32]
) -> float:
    """The cost of the goal, and in ``parents`` from where each cell was reached."""
    reached = np.full(costs.shape[0], np.inf)
    steps = np.array([1, -1, columns, -columns, columns + 1, columns - 1, -columns + 1, -columns - 1])
    across = np.array([1, -1, 0, 0, 1, -1, 1, -1])
    down = np.array([0, 0, 1, -1, 1, 1, -1, -1])
    ring = 4
    while ring * BUCKET_CELLS < (dearest + 1.0) * SQRT_2 + 2 * BUCKET_CELLS:
        ring *= 2
    heads, mask = np.full(ring, -1, np.int32), ring - 1
    capacity, unused, used = 4096, -1, 1
    cell_of, next_of, key_of = np.empty(capacity, np.int32), np.empty(capacity, np.int32), np.empty(capacity)
    goal_x, goal_y = last % columns, last // columns
    bucket = int(_octile(first % columns - goal_x, first // columns - goal_y) / BUCKET_CELLS)
    reached[first], waiting = 0.0, 1
    cell_of[0], next_of[0], key_of[0], heads[bucket & mask] = first, -1, 0.0, 0
    while waiting > 0 and bucket * BUCKET_CELLS < reached[last]:
        entry = heads[bucket & mask]
        if entry < 0:
            bucket += 1
            continue
        heads[bucket & mask] = next_of[entry]
        next_of[entry], unused = unused, entry
        waiting -= 1
        cell, cost = cell_of[entry], key_of[entry]
        if cost > reached[cell] or cell == last:
            continue
        y = cell // columns
        x, y = cell - y * columns - goal_x, y - goal_y
        own = costs[cell]
        for k in range(8):
            neighbour = cell + steps[k]
            if costs[neighbour] == math.inf:
                continue
            length = 1.0
            if k > 3:
                if costs[cell + across[k]] == math.inf or costs[neighbour - across[k]] == math.inf:
                    continue
                length = SQRT_2
            total = cost + length * 0.5 * (own + costs[neighbour])
            if total >= reached[neighbour] - 1e-9:
                continue
            reached[neighbour], parents[neighbour] = total, cell
            value = total + _octile(x + across[k], y + down[k])
            slot = max(int(value * PER_CELL), bucket) & mask
            if unused >= 0:
                place = unused
                unused = next_of[place]
            else:
                place = used
                used += 1
                if used > capacity:
                    cell_of, next_of = np.concatenate((cell_of, cell_of)), np.concatenate((next_of, next_of))
                    key_of, capacity = np.concatenate((key_of, key_of)), 2 * capacity
            cell_of[place], key_of[place] = neighbour, total
            next_of[place], heads[slot] = heads[slot], place
            waiting += 1
    return float(reached[last])


@kernel
def costs_of(path: Integers, costs: Singles) -> Floats:
    """What it costs up to each cell of a path."""
    sums = np.zeros(path.shape[0])
    for i in range(1, path.shape[0]):
        a, b = path[i - 1], path[i]
        length = math.hypot(a[0] - b[0], a[1] - b[1])
        sums[i] = sums[i - 1] + length * 0.5 * (costs[a[0], a[1]] + costs[b[0], b[1]])
    return sums
