"""Finds the direction of the surface at each point of a scan, by a line through its neighbours."""

import itertools
import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.worker.compiled import kernel
from chefbotd.core.poses import Floats

Singles: TypeAlias = NDArray[np.float32]
"""Points and normals are kept in single precision: they are measured to a millimetre at best."""

REACH_M = 0.15
"""Neighbours up to so far away are taken: far enough that a centimetre of noise turns the line by a few degrees."""

MOST = 12
"""Neighbours on either side at most."""

GRAZING = 4.0
"""A gap of so many beam spacings still is one surface: one that is seen under 14 degrees."""

NOISE_M = 0.05
WIDEST_RAD = 0.06
"""Beams further apart than this say nothing about what is between them."""

FLAT = 0.1
"""The most that the variance across the line may be of that along it."""


def normals(points: Singles, sensor_m: Floats | Singles) -> Singles:
    """Unit normals (n, 2) that face the sensor; zeros where there is no line.

    ``points`` (n, 2) are in the order of their beams, in the same frame as ``sensor_m``: one place (2,), or one for each
    point (n, 2). What was seen from different places is no line.
    """
    facing = np.zeros_like(points)
    seen_from_there: Floats = points.astype(np.float64) - sensor_m
    for begin, end in _runs(sensor_m, len(points)):
        _normals(seen_from_there[begin:end], facing[begin:end])
    return facing


def places(sensor_m: Floats | Singles) -> Floats:
    """Where points were seen from as rows, in double precision: one for all of them, or one for each."""
    return np.atleast_2d(sensor_m).astype(np.float64)


def _runs(sensor_m: Floats | Singles, count: int) -> list[tuple[int, int]]:
    """From where to where the points were seen from one place."""
    if sensor_m.ndim == 1 or not count:
        return [(0, count)]
    changes = np.flatnonzero((sensor_m[1:] != sensor_m[:-1]).any(axis=1)) + 1
    limits = [0, *changes.tolist(), count]
    return list(itertools.pairwise(limits))


@kernel
def joined(ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether two points, seen from the origin by beams that follow each other, may lie on one surface."""
    range_m = max(math.hypot(ax, ay), math.hypot(bx, by), 1e-6)
    apart_rad = abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by))
    gap_m = math.hypot(bx - ax, by - ay)
    return apart_rad <= WIDEST_RAD and gap_m <= GRAZING * range_m * apart_rad + NOISE_M


@kernel
def _normals(points: Floats, facing: Singles) -> None:
    sums = np.empty(6)
    for i in range(points.shape[0]):
        sums[:] = 0.0
        if not (_gather_neighbours(points, i, -1, sums) and _gather_neighbours(points, i, 1, sums)):
            continue
        n = sums[0] + 1.0
        xx, xy = sums[3] / n - (sums[1] / n) ** 2, sums[4] / n - sums[1] * sums[2] / n / n
        yy = sums[5] / n - (sums[2] / n) ** 2
        spread = math.hypot((xx - yy) / 2, xy)
        if (xx + yy) / 2 - spread > FLAT * ((xx + yy) / 2 + spread):
            continue
        along_rad = 0.5 * math.atan2(2 * xy, xx - yy)
        nx, ny = -math.sin(along_rad), math.cos(along_rad)
        side = -1.0 if nx * points[i, 0] + ny * points[i, 1] > 0 else 1.0
        facing[i, 0], facing[i, 1] = side * nx, side * ny


@kernel
def _gather_neighbours(points: Floats, i: int, step: int, sums: Floats) -> bool:
    """Add the neighbours on one side to ``sums`` (n, x, y, xx, xy, yy about point i); whether there are any."""
    k, count = i + step, 0
    while 0 <= k < points.shape[0] and count < MOST:
        dx, dy = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1]
        if count > 0 and dx * dx + dy * dy > REACH_M * REACH_M:
            break
        if not joined(points[k - step, 0], points[k - step, 1], points[k, 0], points[k, 1]):
            break
        sums[0], sums[1], sums[2] = sums[0] + 1, sums[1] + dx, sums[2] + dy
        sums[3], sums[4], sums[5] = sums[3] + dx * dx, sums[4] + dx * dy, sums[5] + dy * dy
        count, k = count + 1, k + step
    return count > 0
