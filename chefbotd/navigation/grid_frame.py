"""Converts between the map's frame and the grid's: cell (0, 0) at the origin, columns along x, rows along y."""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record
from chefbotd.mapping.occupancy_grid import OccupancyGrid

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
