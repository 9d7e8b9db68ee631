"""Refines a pose to millimetres: Gauss-Newton on the distances of a scan's points to a submap's surfaces.

On a surface that has a direction only the distance across it counts (point to line: Censi, "An ICP variant using
a point-to-line metric", ICRA 2008), so that a bare corridor does not pretend to know how far along it the robot
is; its information matrix says so. On clutter the distance to the mean point counts, with less weight. Points far
off lose their influence (Geman and McClure's kernel).
"""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.mapping.algorithms.local_map import SURFEL_M, Counts, LocalMap
from chefbotd.components.mapping.algorithms.surfaces import Singles
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.poses import Floats, wrap
from chefbotd.core.record import Record

Indices: TypeAlias = NDArray[np.int64]

UNKNOWN, SURFACE, FREE = 0, 1, 2
INLIER_M = 0.1
ITERATIONS, STEPS = 8, 2
"""How often each point's surface is looked for, and the steps taken in between."""

WIDTHS_M, WIDTH_SIGMAS = (0.2, 0.1), 3.0
"""Where a point loses its influence: wide at first, so that nothing is lost, then by the laser's noise."""

STILL_M, STILL_RAD = 1e-3, 3e-4
CLUTTER_SIGMAS = 3.0
"""The spread of clutter within a cell, in units of the laser's noise."""

HIDDEN = 0.3
"""A surface whose normal is so far against the point's (the cosine) is seen from behind: it is another one."""

REACH_M2 = 0.08
"""All of the cells about a point are nearer (squared)."""

COHERENT = 0.9
"""The mean of the normals in a cell is at least so long where they belong to one surface."""

PASSES_PER_END, PASSES_FREE = 5, 10
"""A cell that beams pass so often is not occupied, whatever ended there once."""


class Fit(Record, frozen=True):
    """A pose, and how the scan fits there.

    ``information`` (3, 3) over x, y and heading is what the scan alone says. Of the points that lie where the map
    knows something (``known``), ``inliers`` are on a surface, and ``contradictions`` in the middle of free space.
    """

    pose: Floats
    information: Floats
    points: int
    known: int
    inliers: int
    contradictions: int
    rms_m: float

    @property
    def share(self) -> float:
        """How much of what could fit does fit, from 0 to 1."""
        return self.inliers / self.known if self.known else 0.0

    @property
    def overlap(self) -> float:
        """How much of the scan lies where the map knows something, from 0 to 1."""
        return self.known / self.points if self.points else 0.0


class Prior(Record, frozen=True):
    """Where the pose is expected, and how surely (an information matrix)."""

    pose: Floats
    information: Floats


def polish(
    grids: LocalMap, points: Singles, facing: Singles, start: Floats, prior: Prior, sigma_m: float
) -> Fit:
    """The pose near ``start`` at which points, normals and prior fit best; ``sigma_m`` is the laser's noise."""
    pose, stats, information = start.copy(), np.zeros(4), np.zeros((3, 3))
    _polish(
        grids, points, facing, pose, prior.pose, prior.information, sigma_m, information, stats
    )  # fmt: skip
    pose[2] = wrap(pose[2:3])[0]
    known_points, inliers, contradictions = (int(count) for count in stats[:3])
    rms_m = math.sqrt(stats[3] / inliers) if inliers else math.inf
    return Fit(pose, information, len(points), known_points, inliers, contradictions, rms_m)


@kernel
def _polish(
    grids: LocalMap,
    points: Singles,
    facing: Singles,
    pose: Floats,
    expected: Floats,
    certainty: Floats,
    sigma_m: float,
    information: Floats,
    stats: Floats,
) -> None:
    """Improve ``pose``: find each point's surface, take some steps with these, and again until nothing moves."""
    system, step = np.zeros((3, 4)), np.zeros(3)
    what, surfaces = np.empty(points.shape[0], np.int64), np.empty((points.shape[0], 5))
    for iteration in range(ITERATIONS):
        _associate(grids, points, facing, pose, what, surfaces)
        x, y, heading = pose[0], pose[1], pose[2]
        width_m = WIDTHS_M[iteration] if iteration < len(WIDTHS_M) else WIDTH_SIGMAS * sigma_m
        for _ in range(STEPS):
            _sum_up(points, pose, sigma_m, width_m, what, surfaces, system, stats)
            _add_prior(system, pose, expected, certainty)
            if not solve3(system, step):
                return
            for k in range(3):
                pose[k] += step[k]
        still = math.hypot(pose[0] - x, pose[1] - y) < STILL_M and abs(pose[2] - heading) < STILL_RAD
        if still and iteration >= len(WIDTHS_M):
            break
    _associate(grids, points, facing, pose, what, surfaces)
    _sum_up(points, pose, sigma_m, WIDTH_SIGMAS * sigma_m, what, surfaces, system, stats)
    information[:, :] = system[:, :3]


@kernel
def _associate(
    grids: LocalMap, points: Singles, facing: Singles, pose: Floats, what: Indices, surfaces: Floats
) -> None:
    """Find the nearest surface of each point, and what is known where it lies."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    ox, oy = pose[0] - grids.origin_m[0], pose[1] - grids.origin_m[1]
    surface, surfels, seen = np.empty(5), grids.surfels, grids.seen
    for i in range(points.shape[0]):
        x = ox + cos * points[i, 0] - sin * points[i, 1]
        y = oy + sin * points[i, 0] + cos * points[i, 1]
        nx, ny = cos * facing[i, 0] - sin * facing[i, 1], sin * facing[i, 0] + cos * facing[i, 1]
        what[i] = nearest(surfels, seen, x, y, nx, ny, surface)
        surfaces[i, 0], surfaces[i, 1] = surface[0] + grids.origin_m[0], surface[1] + grids.origin_m[1]
        surfaces[i, 2], surfaces[i, 3], surfaces[i, 4] = surface[2], surface[3], surface[4]


@kernel
def _sum_up(
    points: Singles,
    pose: Floats,
    sigma_m: float,
    width_m: float,
    what: Indices,
    surfaces: Floats,
    system: Floats,
    stats: Floats,
) -> None:
    """The normal equations of all points: three columns of the information matrix, and the right-hand side."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    system[:, :] = 0.0
    stats[:] = 0.0
    for i in range(points.shape[0]):
        stats[0] += what[i] != UNKNOWN
        stats[2] += what[i] == FREE
        if what[i] != SURFACE:
            continue
        px, py = cos * points[i, 0] - sin * points[i, 1], sin * points[i, 0] + cos * points[i, 1]
        dx, dy = pose[0] + px - surfaces[i, 0], pose[1] + py - surfaces[i, 1]
        if surfaces[i, 4] > 0.0:
            ux, uy = surfaces[i, 2], surfaces[i, 3]
            off = ux * dx + uy * dy
            weight = _weight(off, width_m) / sigma_m**2
            _add(system, ux, uy, uy * px - ux * py, off, weight)
        else:
            off = math.hypot(dx, dy)
            weight = _weight(off, width_m) / (CLUTTER_SIGMAS * sigma_m) ** 2
            _add(system, 1.0, 0.0, -py, dx, weight)
            _add(system, 0.0, 1.0, px, dy, weight)
        if abs(off) < INLIER_M:
            stats[1] += 1
            stats[3] += off * off


@kernel
def _weight(off_m: float, width_m: float) -> float:
    near = 1.0 / (1.0 + (off_m / width_m) ** 2)
    return near * near


@kernel
def _add(system: Floats, jx: float, jy: float, jh: float, off_m: float, weight: float) -> None:
    row = (jx, jy, jh)
    for r in range(3):
        for c in range(3):
            system[r, c] += weight * row[r] * row[c]
        system[r, 3] -= weight * row[r] * off_m


@kernel
def _add_prior(system: Floats, pose: Floats, expected: Floats, certainty: Floats) -> None:
    turn = pose[2] - expected[2]
    turn -= 2 * math.pi * math.floor(turn / (2 * math.pi) + 0.5)
    off = (pose[0] - expected[0], pose[1] - expected[1], turn)
    for r in range(3):
        for c in range(3):
            system[r, c] += certainty[r, c]
            system[r, 3] -= certainty[r, c] * off[c]
        system[r, r] += 1e-9


@kernel
def nearest(surfels: Singles, seen: Counts, x: float, y: float, nx: float, ny: float, surface: Floats) -> int:
    """The surface nearest to a point (relative to the origin) that faces the same way, among the cells about it.

    Fills ``surface`` with its mean point, its normal, and 1 if it has one (0 for clutter).
    """
    row, column = math.floor(y / SURFEL_M), math.floor(x / SURFEL_M)
    rows, columns = surfels.shape[0], surfels.shape[1]
    if row < 1 or column < 1 or row >= rows - 1 or column >= columns - 1:
        return UNKNOWN
    best, behind, bj, bi, bk = REACH_M2, False, 0, 0, -1
    for j in range(row - 1, row + 2):
        for i in range(column - 1, column + 2):
            if surfels[j, i, 0, 0] <= 0.0:
                continue
            if seen[j, i, 1] > PASSES_PER_END * seen[j, i, 0] + PASSES_FREE:
                continue
            for k in range(2):
                weight = surfels[j, i, k, 0]
                if weight <= 0.0:
                    continue
                mx = (i + 0.5) * SURFEL_M + surfels[j, i, k, 1] / weight
                my = (j + 0.5) * SURFEL_M + surfels[j, i, k, 2] / weight
                away = (mx - x) * (mx - x) + (my - y) * (my - y)
                if away >= best:
                    continue
                ux, uy = surfels[j, i, k, 4], surfels[j, i, k, 5]
                facing = ux * nx + uy * ny
                if facing < 0.0 and facing * facing > HIDDEN * HIDDEN * (ux * ux + uy * uy):
                    behind = True
                    continue
                best, bj, bi, bk = away, j, i, k
    if bk < 0:
        return FREE if seen[row, column, 1] > 0 and not behind else UNKNOWN
    _describe(surfels[bj, bi, bk], (bi + 0.5) * SURFEL_M, (bj + 0.5) * SURFEL_M, surface)
    return SURFACE


@kernel
def _describe(cell: Singles, x: float, y: float, surface: Floats) -> None:
    """The surface in a cell whose center is (x, y): its mean point, its normal, and whether it has one."""
    size = math.hypot(cell[4], cell[5])
    flat = cell[3] > 0.5 * cell[0] and size > COHERENT * cell[3]
    surface[0], surface[1], surface[4] = x + cell[1] / cell[0], y + cell[2] / cell[0], 1.0 if flat else 0.0
    if flat:
        surface[2], surface[3] = cell[4] / size, cell[5] / size


@kernel
def solve3(system: Floats, solution: Floats) -> bool:
    """Solve three equations with a symmetric positive definite matrix (Cholesky); False if it is none."""
    lower = np.zeros((3, 3))
    for r in range(3):
        for c in range(r + 1):
            rest = system[r, c]
            for k in range(c):
                rest -= lower[r, k] * lower[c, k]
            if r == c:
                if not rest > 0.0:
                    return False
                lower[r, r] = math.sqrt(rest)
            else:
                lower[r, c] = rest / lower[c, c]
    for r in range(3):
        rest = system[r, 3]
        for k in range(r):
            rest -= lower[r, k] * solution[k]
        solution[r] = rest / lower[r, r]
    for r in range(2, -1, -1):
        rest = solution[r]
        for k in range(r + 1, 3):
            rest -= lower[k, r] * solution[k]
        solution[r] = rest / lower[r, r]
    return True
