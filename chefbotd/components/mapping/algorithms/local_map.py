"""A submap of a few metres' travel to match scans against: likelihoods for the search, surfaces for the refinement.

Four grids share an origin. ``likelihood`` (5 cm) says how likely a beam ends in a cell, smeared by what the
laser and the pose leave open; ``coarse`` (20 cm) bounds it from above for every shift within its cell (Olson,
"Real-Time Correlative Scan Matching", ICRA 2009). ``surfels`` (10 cm) hold the mean of the points in a cell and
of their normals, so that no precision is lost to the grid; the two sides of a thin wall are kept apart. ``seen``
counts the beams that ended in a cell and those that passed it: where a person walked through, the passes soon
outnumber the ends.
"""

import math
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.mapping.algorithms.surfaces import Singles, joined, places
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.poses import Floats, transform

Bytes: TypeAlias = NDArray[np.uint8]
Counts: TypeAlias = NDArray[np.uint16]

CELL_M = 0.05
SURFEL_M = 0.1
COARSE_M = 0.2
BLOCK_M = 3.2
"""The grids grow by whole blocks, so that all of them stay aligned."""

SMEAR_M = 0.06
REACH = 3
"""Cells over which a point is smeared, on either side."""

FILL_WEIGHT = 0.25
"""What a point between two beams on one surface weighs: it was inferred, not measured."""

CLEAR_M = 0.15
"""A beam says nothing about the last bit before its end: that is in the noise, or a slanted surface."""

MOST = 65535
SMEAR = np.array(
    [[255.0 * math.exp(-(d / 8.0) / 2 / (SMEAR_M / CELL_M) ** 2) for d in range(8 * 40)]], np.float64
).astype(np.uint8)[0]
"""The smear by squared distance, in eighths of a squared cell."""


class LocalMap(NamedTuple):
    """The grids, row by y; ``origin_m`` is the corner of their first cell."""

    origin_m: Floats
    likelihood: Bytes
    coarse: Bytes
    surfels: Singles
    seen: Counts


def empty() -> LocalMap:
    """A map of nothing; it grows with what is inserted."""
    return LocalMap(
        np.zeros(2),
        np.zeros((0, 0), np.uint8),
        np.zeros((0, 0), np.uint8),
        np.zeros((0, 0, 2, 6), np.float32),
        np.zeros((0, 0, 2), np.uint16),
    )


def insert_scan(
    into: LocalMap, pose: Floats, sensor_m: Floats | Singles, points: Singles, facing: Singles
) -> LocalMap:
    """The map with a scan in it, taken at ``pose``; it uses up ``into``, whose grids it fills.

    ``points`` (n, 2) and their normals ``facing`` are in the frame of ``pose``, seen from ``sensor_m`` in it: one place
    (2,), or one for each point (n, 2).
    """
    sensors = places(sensor_m)
    from_m, placed = transform(pose, sensors), transform(pose, points)
    grown = _grow_map(into, np.vstack([from_m, placed]))
    turned = transform(np.array([0.0, 0.0, pose[2]]), facing)
    _fill(grown, sensors, points, from_m, placed, turned)
    return grown


def _grow_map(old: LocalMap, placed: Floats) -> LocalMap:
    """The map with room for all of these points, and for their smear."""
    low, high = placed.min(axis=0) - BLOCK_M / 8, placed.max(axis=0) + BLOCK_M / 8
    if old.likelihood.size:
        end = old.origin_m + np.array(old.likelihood.shape[::-1]) * CELL_M
        if (low >= old.origin_m).all() and (high <= end).all():
            return old
        low, high = np.minimum(low, old.origin_m + BLOCK_M / 2), np.maximum(high, end - BLOCK_M / 2)
    first, last = np.floor(low / BLOCK_M), np.ceil(high / BLOCK_M)
    blocks = (last - first).astype(int)
    moved = np.rint(old.origin_m / BLOCK_M - first).astype(int) if old.likelihood.size else np.zeros(2, int)
    return LocalMap(
        first * BLOCK_M,
        _larger(old.likelihood, blocks, moved, CELL_M),
        _larger(old.coarse, blocks, moved, COARSE_M),
        _larger(old.surfels, blocks, moved, SURFEL_M),
        _larger(old.seen, blocks, moved, SURFEL_M),
    )


def _larger(
    grid: NDArray[Any], blocks: NDArray[np.int_], moved: NDArray[np.int_], cell_m: float
) -> NDArray[Any]:
    per_block = round(BLOCK_M / cell_m)
    room = np.zeros((blocks[1] * per_block, blocks[0] * per_block, *grid.shape[2:]), grid.dtype)
    y, x = moved[1] * per_block, moved[0] * per_block
    room[y : y + grid.shape[0], x : x + grid.shape[1]] = grid
    return room


@kernel
def _fill(
    into: LocalMap, sensors: Floats, points: Singles, from_m: Floats, placed: Floats, facing: Floats
) -> None:
    ox, oy = into.origin_m[0], into.origin_m[1]
    last = sensors.shape[0] - 1
    for i in range(points.shape[0]):
        s = min(i, last)
        x, y = placed[i, 0] - ox, placed[i, 1] - oy
        clear(into.seen, SURFEL_M, from_m[s, 0] - ox, from_m[s, 1] - oy, x, y)
        row, column = int(y / SURFEL_M), int(x / SURFEL_M)
        if into.seen[row, column, 0] < MOST:
            into.seen[row, column, 0] += 1
        nx, ny = facing[i, 0], facing[i, 1]
        smear(into.likelihood, into.coarse, x, y)
        gather(into.surfels, x, y, nx, ny, 1.0)
        if i == 0 or nx * facing[i - 1, 0] + ny * facing[i - 1, 1] < 0.9:
            continue
        sx, sy, before = sensors[s, 0], sensors[s, 1], min(i - 1, last)
        if sx != sensors[before, 0] or sy != sensors[before, 1]:
            continue
        if not joined(points[i - 1, 0] - sx, points[i - 1, 1] - sy, points[i, 0] - sx, points[i, 1] - sy):
            continue
        dx, dy = placed[i - 1, 0] - placed[i, 0], placed[i - 1, 1] - placed[i, 1]
        steps = int(math.hypot(dx, dy) / SURFEL_M)
        for k in range(1, steps + 1):
            part = k / (steps + 1)
            smear(into.likelihood, into.coarse, x + part * dx, y + part * dy)
            gather(into.surfels, x + part * dx, y + part * dy, nx, ny, FILL_WEIGHT)


@kernel
def smear(likelihood: Bytes, coarse: Bytes, x: float, y: float) -> None:
    """Raise the likelihoods about a point, and the bounds on them."""
    row, column = int(y / CELL_M), int(x / CELL_M)
    off_x, off_y = column + 0.5 - x / CELL_M, row + 0.5 - y / CELL_M
    for j in range(max(row - REACH, 0), min(row + REACH + 1, likelihood.shape[0])):
        for i in range(max(column - REACH, 0), min(column + REACH + 1, likelihood.shape[1])):
            dx, dy = i - column + off_x, j - row + off_y
            value = SMEAR[int(8.0 * (dx * dx + dy * dy))]
            if value <= likelihood[j, i]:
                continue
            likelihood[j, i] = value
            # Shifted by up to 3 cells, a fine cell is also met from the coarse cell before its own.
            top, left = j // 4, i // 4
            above, before = max((j - 3) // 4, 0), max((i - 3) // 4, 0)
            coarse[top, left] = max(coarse[top, left], value)
            coarse[top, before] = max(coarse[top, before], value)
            coarse[above, left] = max(coarse[above, left], value)
            coarse[above, before] = max(coarse[above, before], value)


@kernel
def gather(surfels: Singles, x: float, y: float, nx: float, ny: float, weight: float) -> None:
    """Add a point to its cell: to the second layer if its normal looks away from what is in the first."""
    j, i = int(y / SURFEL_M), int(x / SURFEL_M)
    layer = 1 if surfels[j, i, 0, 4] * nx + surfels[j, i, 0, 5] * ny < 0.0 else 0
    surfels[j, i, layer, 0] += weight
    surfels[j, i, layer, 1] += weight * (x - (i + 0.5) * SURFEL_M)
    surfels[j, i, layer, 2] += weight * (y - (j + 0.5) * SURFEL_M)
    if nx != 0.0 or ny != 0.0:
        surfels[j, i, layer, 3] += weight
        surfels[j, i, layer, 4] += weight * nx
        surfels[j, i, layer, 5] += weight * ny


@kernel
def clear(seen: Counts, cell_m: float, fx: float, fy: float, tx: float, ty: float) -> None:
    """Count a pass in each cell between the sensor and shortly before the beam's end.

    The walk from border to border is Amanatides and Woo's ("A Fast Voxel Traversal Algorithm", 1987).
    """
    whole = math.hypot(tx - fx, ty - fy)
    length = whole - CLEAR_M
    if length <= 0.0:
        return
    ux, uy = (tx - fx) / whole, (ty - fy) / whole
    column, row = int(fx / cell_m), int(fy / cell_m)
    step_x, step_y = (1 if ux > 0 else -1), (1 if uy > 0 else -1)
    per_x = cell_m / abs(ux) if ux != 0.0 else 1e30
    per_y = cell_m / abs(uy) if uy != 0.0 else 1e30
    next_x = ((column + (ux > 0)) * cell_m - fx) / ux if ux != 0.0 else 1e30
    next_y = ((row + (uy > 0)) * cell_m - fy) / uy if uy != 0.0 else 1e30
    while True:
        if seen[row, column, 1] < MOST:
            seen[row, column, 1] += 1
        if min(next_x, next_y) > length:
            return
        if next_x < next_y:
            next_x += per_x
            column += step_x
        else:
            next_y += per_y
            row += step_y
