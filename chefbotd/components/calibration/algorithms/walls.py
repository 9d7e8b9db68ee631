"""Finds straight walls among the points of many scans: the commonest line first, then the commonest of what is left."""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.scan_motion import NOISE_M

Indices: TypeAlias = NDArray[np.int64]

DIRECTIONS, DISTANCE_M = 72, 0.05
"""The bins in which lines are counted: of 5 degrees and 5 cm."""

LEAST_POINTS, MOST_WALLS = 800, 60
REACHES_M = (0.08, 0.06, 0.05, 0.05, 0.05)
"""How near to the line its points are, while it is fitted to them again and again."""

FACING = math.cos(math.radians(35))
"""Points whose normals are farther from the line's are of something else, such as the wall's other side."""

MOST_SPREAD_M = 1.6 * NOISE_M
"""Points that scatter more about their line are of no wall."""

PIECE_M = 1.0
"""So far a wall counts as straight."""


def wall_pieces(points: Floats, facing: Floats) -> Indices:
    """On which piece of a wall each of the points (n, 2) with these normals (n, 2) lies; -1: on none."""
    piece = np.full(len(points), -1)
    left = np.hypot(facing[:, 0], facing[:, 1]) > 0.5
    bin_rad = math.tau / DIRECTIONS
    direction = (np.arctan2(facing[:, 1], facing[:, 0]) % math.tau / bin_rad).astype(np.int64) % DIRECTIONS
    along_rad = (direction + 0.5) * bin_rad
    distance_m = np.cos(along_rad) * points[:, 0] + np.sin(along_rad) * points[:, 1]
    row = np.floor(distance_m / DISTANCE_M).astype(np.int64)
    line = direction * (np.ptp(row) + 1) + row - row.min() if len(row) else row
    count = 0
    for _ in range(MOST_WALLS):
        if np.count_nonzero(left) < LEAST_POINTS:
            break
        commonest = np.bincount(line[left]).argmax()
        inside = left & (line == commonest)
        normal, centre, near = _line(points, facing, left, inside)
        left &= ~(near | inside)
        off_m = (points[near] - centre) @ normal
        if np.count_nonzero(near) < LEAST_POINTS or off_m.std() > MOST_SPREAD_M:
            continue
        stretch = np.floor((points[near] - centre) @ np.array([-normal[1], normal[0]]) / PIECE_M)
        numbers = np.unique(stretch, return_inverse=True)[1].ravel()
        piece[near] = count + numbers
        count += int(numbers.max()) + 1
    return piece


def _line(
    points: Floats, facing: Floats, left: NDArray[np.bool_], inside: NDArray[np.bool_]
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """The normal and a point of the line through the points inside, and which of those that are left lie on it."""
    normal, centre, near = facing[inside].mean(axis=0), points[inside].mean(axis=0), inside
    normal /= max(math.hypot(*normal), 1e-9)
    for reach_m in REACHES_M:
        chosen = left & (facing @ normal > FACING) & (np.abs((points - centre) @ normal) < reach_m)
        if np.count_nonzero(chosen) < 2:
            break
        near, centre = chosen, points[chosen].mean(axis=0)
        tangent = np.array([-normal[1], normal[0]])
        along_m, off_m = (points[near] - centre) @ tangent, (points[near] - centre) @ normal
        normal = normal - float(along_m @ off_m) / max(float(along_m @ along_m), 1e-9) * tangent
        normal /= math.hypot(*normal)
    return normal, centre, near
