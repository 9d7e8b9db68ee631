"""Smooths a path over cells into one that a robot can drive: straight lines, round corners, checked again."""

import math

import numpy as np

from chefbotd.components.navigation.algorithms.costmap import between_cells
from chefbotd.components.navigation.algorithms.grid import Flags, Floats, Singles
from chefbotd.components.navigation.algorithms.outline import clearance_m
from chefbotd.components.navigation.algorithms.search import Integers, costs_of
from chefbotd.components.worker.compiled import kernel

MOST_FAILURES = 30
ROUNDS = 60
WORTH = 1.02


def straighten_path(cells: Integers, costs: Singles, cell_m: float) -> Floats:
    """The corners (n, 2) of a path of straight lines, in metres, that costs no more than the path over cells.

    From each corner the line goes to the farthest cell that it reaches for at most 2 percent more than the path does.
    """
    sums = costs_of(cells, costs)
    kept = np.zeros(len(cells), np.bool_)
    _pull(cells, sums, costs, kept)
    return np.asarray((cells[kept][:, ::-1] + 0.5) * cell_m, np.float64)


@kernel
def _pull(cells: Integers, sums: Floats, costs: Singles, kept: Flags) -> None:
    i, n = 0, cells.shape[0]
    kept[0] = kept[n - 1] = True
    while i < n - 1:
        best, failures, j = i + 1, 0, i + 2
        while j < n and failures < MOST_FAILURES:
            if _line_cost(costs, cells[i], cells[j]) <= (sums[j] - sums[i]) * WORTH:
                best, failures = j, 0
            else:
                failures += 1
            j += 1
        kept[best] = True
        i = best


@kernel
def _line_cost(costs: Singles, a: Integers, b: Integers) -> float:
    """What a straight line between the middles of two cells costs; infinite where it meets a blocked one."""
    length = math.hypot(a[0] - b[0], a[1] - b[1])
    steps = math.ceil(length * 2)
    total = 0.0
    for k in range(steps + 1):
        row = a[0] + (b[0] - a[0]) * k / steps
        column = a[1] + (b[1] - a[1]) * k / steps
        cost = costs[int(row + 0.5), int(column + 0.5)]
        if cost == math.inf:
            return math.inf
        total += cost * (0.5 if k in (0, steps) else 1.0)
    return total * length / steps


def resample_path(corners: Floats, spacing_m: float) -> Floats:
    """Points (n, 2) along straight lines through the corners, at most ``spacing_m`` apart, evenly between its ends."""
    lengths = np.hypot(*np.diff(corners, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    count = max(math.ceil(along[-1] / spacing_m), 1)
    at = np.linspace(0.0, along[-1], count + 1)
    return np.stack([np.interp(at, along, corners[:, 0]), np.interp(at, along, corners[:, 1])], axis=1)


def round_corners(
    points: Floats, costs: Singles, distance_m: Singles, standing_m: Singles, cell_m: float, wide_m: float
) -> Floats:
    """The points with corners rounded and, where it is narrow, moved to the middle; the ends stay.

    Each point moves towards the middle of its neighbours, and away from obstacles and people nearer than ``wide_m``;
    not where that takes it into a blocked cell or nearer to one of these than it was, unless it is ``wide_m`` away.
    Nobody who walks moves it nearer to what stands (``standing_m``): he will be gone, and the wall will not.
    """
    moved = points.copy()
    _relax(moved, costs, distance_m, standing_m, cell_m, wide_m)
    return moved


@kernel
def _relax(
    points: Floats, costs: Singles, distance_m: Singles, standing_m: Singles, cell_m: float, wide_m: float
) -> None:
    n, step = points.shape[0], 0.5 * cell_m
    for _ in range(ROUNDS):
        for i in range(1, n - 1):
            x, y = points[i, 0], points[i, 1]
            here_m = between_cells(distance_m, cell_m, x, y)
            to_x = x + 0.4 * (0.5 * (points[i - 1, 0] + points[i + 1, 0]) - x)
            to_y = y + 0.4 * (0.5 * (points[i - 1, 1] + points[i + 1, 1]) - y)
            if here_m < wide_m:
                push = 0.1 * cell_m * (wide_m - here_m) / wide_m
                right = between_cells(distance_m, cell_m, x + step, y)
                left = between_cells(distance_m, cell_m, x - step, y)
                up = between_cells(distance_m, cell_m, x, y + step)
                down = between_cells(distance_m, cell_m, x, y - step)
                if max(right, left, up, down) < math.inf:
                    to_x += push * (right - left) / cell_m
                    to_y += push * (up - down) / cell_m
            if costs[int(to_y / cell_m), int(to_x / cell_m)] == math.inf:
                continue
            to_m = between_cells(distance_m, cell_m, to_x, to_y)
            stood_m = between_cells(standing_m, cell_m, x, y)
            stands_m = between_cells(standing_m, cell_m, to_x, to_y)
            if to_m >= min(here_m, wide_m) - 1e-6 and stands_m >= min(stood_m, wide_m) - 1e-6:
                points[i, 0], points[i, 1] = to_x, to_y


def headings(points: Floats) -> Floats:
    """The heading at each point, radians."""
    ahead = np.diff(points, axis=0)
    heading_rad = np.arctan2(ahead[:, 1], ahead[:, 0])
    return np.append(heading_rad, heading_rad[-1])


def first_touch(
    points: Floats, heading_rad: Floats, hull: Floats, pad_m: float, distance_m: Singles, cell_m: float
) -> int:
    """The first pose at which an obstacle's cell (its middle) is inside the outline; -1: none."""
    return int(_first_touch(points, heading_rad, hull, pad_m, distance_m, cell_m))


@kernel
def _first_touch(
    points: Floats, heading_rad: Floats, hull: Floats, pad_m: float, distance_m: Singles, cell_m: float
) -> int:
    outer = 0.0
    for k in range(hull.shape[0]):
        outer = max(outer, math.hypot(hull[k, 0], hull[k, 1]) + pad_m)
    for i in range(points.shape[0]):
        if between_cells(distance_m, cell_m, points[i, 0], points[i, 1]) > outer + cell_m:
            continue
        if touches(points[i, 0], points[i, 1], heading_rad[i], hull, pad_m, outer, distance_m, cell_m):
            return i
    return -1


@kernel
def touches(
    x_m: float,
    y_m: float,
    heading_rad: float,
    hull: Floats,
    pad_m: float,
    outer_m: float,
    distance_m: Singles,
    cell_m: float,
) -> bool:
    """Whether the middle of an obstacle's cell is inside the outline at a pose."""
    rows, columns = distance_m.shape
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    for row in range(max(int((y_m - outer_m) / cell_m), 0), min(int((y_m + outer_m) / cell_m) + 1, rows)):
        for column in range(
            max(int((x_m - outer_m) / cell_m), 0), min(int((x_m + outer_m) / cell_m) + 1, columns)
        ):
            if distance_m[row, column] > 0:
                continue
            dx, dy = (column + 0.5) * cell_m - x_m, (row + 0.5) * cell_m - y_m
            if clearance_m(hull, pad_m, cos * dx + sin * dy, cos * dy - sin * dx) < 0:
                return True
    return False
