"""Computes the fit of a scan to a map, beam by beam: the number that decides whether a pose is accepted.

A beam agrees if it ends at a surface that faces it. It contradicts if it ends where the map is free, or if it went
through a wall of the map. What ends too early may be a person or a chair, so it weighs less; nobody goes through
walls, though a lidar sees through glass. A beam that ends where nothing is known says nothing.
"""

import math

import numpy as np

from chefbotd.components.mapping.algorithms.local_map import CELL_M, SURFEL_M, LocalMap
from chefbotd.components.mapping.algorithms.refine import INLIER_M, SURFACE, UNKNOWN, Indices, nearest
from chefbotd.components.mapping.algorithms.state import Scan
from chefbotd.components.mapping.algorithms.surfaces import Singles, places
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.poses import Floats
from chefbotd.core.record import Record

EARLY_WEIGHT = 0.5
STEP_M = 0.04
NEAR_END_M = 0.25
"""The last bit of a beam crosses nothing: it is where the surface itself lies."""

ON_SURFACE = 190
"""A likelihood that is met within 4 cm of a surface."""

HEAD_ON = 0.35
"""The cosine from which a beam goes through a surface, and not along it."""


class Agreement(Record, frozen=True):
    """How many of a scan's beams agree, end too early, go through a wall, and end where nothing is known."""

    agree: int
    early: int
    through: int
    unknown: int

    @property
    def fit(self) -> float:
        """From 0 to 1: 1 if all beams that say something agree, 0 if none does, or none says anything."""
        against = self.through + EARLY_WEIGHT * self.early
        return self.agree / (self.agree + against) if self.agree else 0.0

    @property
    def contradiction(self) -> float:
        """Which share of the beams that say something goes through a wall."""
        informative = self.agree + self.early + self.through
        return self.through / informative if informative else 0.0

    @property
    def overlap(self) -> float:
        """Which share of the beams says something."""
        informative = self.agree + self.early + self.through
        return informative / (informative + self.unknown) if informative else 0.0


def agreement(grids: LocalMap, pose: Floats, scan: Scan) -> Agreement:
    """How a scan taken at ``pose`` agrees with the map."""
    counts = np.zeros(4, np.int64)
    _agreement(grids, pose, places(scan.sensor_m), scan.points, scan.facing, counts)
    agree, early, through, unknown = (int(count) for count in counts)
    return Agreement(agree, early, through, unknown)


@kernel
def _agreement(
    grids: LocalMap, pose: Floats, sensors: Floats, points: Singles, facing: Singles, counts: Indices
) -> None:
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    ox, oy = pose[0] - grids.origin_m[0], pose[1] - grids.origin_m[1]
    surface = np.empty(5)
    for i in range(points.shape[0]):
        s = min(i, sensors.shape[0] - 1)
        sx, sy = (
            ox + cos * sensors[s, 0] - sin * sensors[s, 1],
            oy + sin * sensors[s, 0] + cos * sensors[s, 1],
        )
        x = ox + cos * points[i, 0] - sin * points[i, 1]
        y = oy + sin * points[i, 0] + cos * points[i, 1]
        if _goes_through(grids, sx, sy, x, y):
            counts[2] += 1
            continue
        nx, ny = cos * facing[i, 0] - sin * facing[i, 1], sin * facing[i, 0] + cos * facing[i, 1]
        what = nearest(grids.surfels, grids.seen, x, y, nx, ny, surface)
        if what == UNKNOWN:
            counts[3] += 1
            continue
        counts[0 if what == SURFACE and _is_on(surface, x, y) else 1] += 1


@kernel
def _is_on(surface: Floats, x: float, y: float) -> bool:
    dx, dy = x - surface[0], y - surface[1]
    if surface[4] > 0.0:
        return bool(abs(surface[2] * dx + surface[3] * dy) < INLIER_M)
    return bool(math.hypot(dx, dy) < INLIER_M)


@kernel
def _goes_through(grids: LocalMap, sx: float, sy: float, x: float, y: float) -> bool:
    """Whether the beam from (sx, sy) passes a surface on its way to (x, y), well before its end."""
    whole = math.hypot(x - sx, y - sy)
    steps = int((whole - NEAR_END_M) / STEP_M)
    if steps <= 0:
        return False
    ux, uy = (x - sx) / whole, (y - sy) / whole
    rows, columns = grids.likelihood.shape[0], grids.likelihood.shape[1]
    for k in range(1, steps + 1):
        px, py = sx + k * STEP_M * ux, sy + k * STEP_M * uy
        row, column = math.floor(py / CELL_M), math.floor(px / CELL_M)
        if not (0 <= row < rows and 0 <= column < columns):
            continue
        if grids.likelihood[row, column] >= ON_SURFACE and _is_passed(grids.surfels, px, py, sx, sy, x, y):
            return True
    return False


@kernel
def _is_passed(surfels: Singles, px: float, py: float, sx: float, sy: float, x: float, y: float) -> bool:
    """Whether a flat surface in the cell of (px, py) has the beam's begin on one side and its end on the other."""
    row, column = math.floor(py / SURFEL_M), math.floor(px / SURFEL_M)
    whole = math.hypot(x - sx, y - sy)
    for layer in range(2):
        weight, flat = surfels[row, column, layer, 0], surfels[row, column, layer, 3]
        size = math.hypot(surfels[row, column, layer, 4], surfels[row, column, layer, 5])
        if weight <= 0.0 or flat <= 0.5 * weight or size <= 0.9 * flat:
            continue
        nx, ny = surfels[row, column, layer, 4] / size, surfels[row, column, layer, 5] / size
        mx = (column + 0.5) * SURFEL_M + surfels[row, column, layer, 1] / weight
        my = (row + 0.5) * SURFEL_M + surfels[row, column, layer, 2] / weight
        before, after = nx * (sx - mx) + ny * (sy - my), nx * (x - mx) + ny * (y - my)
        if before * after < 0.0 and abs(after) > 0.15 and abs(after - before) > HEAD_ON * whole:
            return True
    return False
