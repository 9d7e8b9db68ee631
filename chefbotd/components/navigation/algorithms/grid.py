"""The grid's frame in the map, and the exact distance of each cell from the nearest obstacle.

Cell (0, 0) is at the grid's origin, columns run along x, rows along y.
"""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.worker.compiled import kernel
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.record import Record

Floats: TypeAlias = NDArray[np.float64]


class GridFrame(Record, frozen=True):
    """Where a grid of ``rows`` by ``columns`` lies in the map; a map whose origin is turned is no special case."""

    resolution_m: float
    map_from_grid: Pose2D
    rows: int
    columns: int

    @classmethod
    def of(cls, grid: OccupancyGrid) -> "GridFrame":
        """The frame of a map."""
        rows, columns = grid.percent.shape
        return cls(grid.resolution_m, grid.map_from_grid, rows, columns)

    def to_grid(self, points_m: Floats) -> Floats:
        """Points (n, 2) of the map in the grid's frame, in metres."""
        origin = self.map_from_grid
        cos, sin = math.cos(origin.heading_rad), math.sin(origin.heading_rad)
        turned: Floats = (points_m - [origin.x_m, origin.y_m]) @ np.array([[cos, -sin], [sin, cos]])
        return turned

    def to_map(self, points_m: Floats) -> Floats:
        """Points (n, 2) of the grid's frame in the map."""
        origin = self.map_from_grid
        cos, sin = math.cos(origin.heading_rad), math.sin(origin.heading_rad)
        turned: Floats = points_m @ np.array([[cos, sin], [-sin, cos]]) + [origin.x_m, origin.y_m]
        return turned

    def pose_to_grid(self, pose: Pose2D) -> Pose2D:
        """A pose of the map in the grid's frame."""
        return self.map_from_grid.inverse().compose(pose)

    def pose_to_map(self, pose: Pose2D) -> Pose2D:
        """A pose of the grid's frame in the map."""
        return self.map_from_grid.compose(pose)

    def cell(self, x_m: float, y_m: float) -> tuple[int, int] | None:
        """The row and column of a point of the grid's frame; None outside."""
        row, column = math.floor(y_m / self.resolution_m), math.floor(x_m / self.resolution_m)
        inside = 0 <= row < self.rows and 0 <= column < self.columns
        return (row, column) if inside else None

    def center(self, row: int, column: int) -> tuple[float, float]:
        """The middle of a cell, (x, y) in the grid's frame."""
        return (column + 0.5) * self.resolution_m, (row + 0.5) * self.resolution_m


Flags = NDArray[np.bool_]
Singles = NDArray[np.float32]


def distances_m(obstacles: Flags, resolution_m: float) -> Singles:
    """From each cell's middle to that of the nearest obstacle's cell; infinite where there is none.

    Method: Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled Functions", Theory of Computing 8, 2012.
    """
    distance_m = np.empty(obstacles.shape, np.float32)
    _transform(obstacles, resolution_m, distance_m)
    return distance_m


@kernel
def _transform(obstacles: Flags, resolution_m: float, distance_m: Singles) -> None:
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
            distance_m[row, column] = math.sqrt(value) * resolution_m if value < far * far else math.inf


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


def place_points(pose: Pose2D, points_m: Floats) -> Floats:
    """Points of the pose's frame in the frame that the pose is in."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    turned: Floats = points_m @ np.array([[cos, sin], [-sin, cos]]) + [pose.x_m, pose.y_m]
    return turned
