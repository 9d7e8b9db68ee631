"""An occupancy grid: how likely each cell of a map is occupied, in percent."""

import numpy as np
import numpy.typing as npt

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record

UNKNOWN, FREE, OCCUPIED = -1, 0, 100


class OccupancyGrid(Record, frozen=True):
    """A map of square cells; ``map_from_grid`` is where the outer corner of cell (0, 0) lies in ``map``.

    ``percent`` is int8 of shape (rows, columns): -1 for unknown, else 0 (free) to 100 (occupied). Columns run along the
    grid's x axis, rows along its y axis, as in ROS's OccupancyGrid message.

    Raises:
        ValueError: the resolution is not positive, or the array is not what is said here.
    """

    resolution_m: float
    map_from_grid: Pose2D
    percent: npt.NDArray[np.int8]

    def __post_init__(self) -> None:
        if not self.resolution_m > 0:
            raise ValueError(f"a grid's resolution is above 0 m, got {self.resolution_m}")
        if self.percent.ndim != 2 or self.percent.dtype != np.int8 or 0 in self.percent.shape:
            got = f"{self.percent.dtype} of shape {self.percent.shape}"
            raise ValueError(f"a grid is an int8 array of rows and columns, got {got}")
        if self.percent.min() < UNKNOWN or self.percent.max() > OCCUPIED:
            raise ValueError(f"cells are from -1 to 100, got {self.percent.min()} to {self.percent.max()}")


def crop_grid(grid: OccupancyGrid, margin_m: float) -> OccupancyGrid:
    """The grid without what is unknown all round, but for a margin; what is known stays where it is in ``map``."""
    is_known = grid.percent != UNKNOWN
    rows, columns = np.flatnonzero(is_known.any(axis=1)), np.flatnonzero(is_known.any(axis=0))
    if not len(rows):
        return grid
    margin = round(margin_m / grid.resolution_m)
    top, left = max(int(rows[0]) - margin, 0), max(int(columns[0]) - margin, 0)
    percent = grid.percent[top : int(rows[-1]) + margin + 1, left : int(columns[-1]) + margin + 1]
    if percent.shape == grid.percent.shape:
        return grid
    corner = Pose2D(left * grid.resolution_m, top * grid.resolution_m, 0.0)
    return OccupancyGrid(grid.resolution_m, grid.map_from_grid.compose(corner), np.ascontiguousarray(percent))
