"""Computes the exact distance of each cell from the nearest obstacle."""

import math

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.compiled import kernel
from chefbotd.navigation.grid_frame import Floats

Flags = NDArray[np.bool_]
Singles = NDArray[np.float32]


def distances_m(obstacles: Flags, resolution_m: float) -> Singles:
    """From each cell's middle to that of the nearest obstacle's cell; infinite where there is none.

    Method: Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled Functions", Theory of Computing 8, 2012.
    """
    found = np.empty(obstacles.shape, np.float32)
    _transform(obstacles, resolution_m, found)
    return found


@kernel
def _transform(obstacles: Flags, resolution_m: float, found: Singles) -> None:
    rows, columns = obstacles.shape
    far = rows + columns
    above = np.empty((rows, columns), np.int64)
    for column in range(columns):
        gap = far
        for row in range(rows):
            gap = 0 if obstacles[row, column] else gap + 1
            above[row, column] = gap
        for row in range(rows - 2, -1, -1):
            above[row, column] = min(above[row, column], above[row + 1, column] + 1)
    vertex, begin, squared = np.empty(columns, np.int64), np.empty(columns + 1), np.empty(columns)
    for row in range(rows):
        for column in range(columns):
            squared[column] = float(above[row, column]) ** 2
        _lower_envelope(squared, vertex, begin)
        k = 0
        for column in range(columns):
            while begin[k + 1] < column:
                k += 1
            value = (column - vertex[k]) ** 2 + squared[vertex[k]]
            found[row, column] = math.sqrt(value) * resolution_m if value < far * far else math.inf


@kernel
def _lower_envelope(squared: Floats, vertex: NDArray[np.int64], begin: Floats) -> None:
    """Which parabola is the lowest, and from where on."""
    k = 0
    vertex[0], begin[0], begin[1] = 0, -math.inf, math.inf
    for q in range(1, squared.shape[0]):
        while True:
            v = vertex[k]
            crossing = ((squared[q] + q * q) - (squared[v] + v * v)) / (2.0 * (q - v))
            if crossing > begin[k]:
                break
            k -= 1
        k += 1
        vertex[k], begin[k], begin[k + 1] = q, crossing, math.inf
