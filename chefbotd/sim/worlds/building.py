"""A building that comes with the simulator, and its map at the height of a lidar."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from chefbotd.core.geometry import Pose2D
from chefbotd.mapping.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from chefbotd.sim.arrays import Vector
from chefbotd.sim.worlds.solids import Solid

RESOLUTION_M = 0.02
MARGIN_M = 0.2
SLICE_M = 0.2
"""The height of a lidar on a small robot (assumed): what a map shows."""


@dataclass(frozen=True, slots=True)
class Building:
    """Walls and furniture; what closes its doors; where a robot starts; a free point in each room; a drive through them.

    ``outside`` are points that are seen through glass.
    """

    name: str
    solids: tuple[Solid, ...]
    doors: tuple[Solid, ...]
    start: Pose2D
    rooms: Mapping[str, tuple[float, float]]
    tour: tuple[tuple[float, float], ...]
    outside: tuple[tuple[float, float], ...] = ()

    def grid(self) -> OccupancyGrid:
        """The map with its doors open, in cells of 2 cm.

        Free is what is connected with a room, or with what is seen through glass; the inside of furniture is occupied.
        """
        corners = np.concatenate([solid.corners for solid in self.solids])
        low = np.floor((corners.min(axis=0) - MARGIN_M) / RESOLUTION_M) * RESOLUTION_M
        columns, rows = np.ceil((corners.max(axis=0) + MARGIN_M - low) / RESOLUTION_M).astype(int)
        occupied = np.zeros((rows, columns), np.bool_)
        for solid in self.solids:
            if solid.bottom_m <= SLICE_M < solid.top_m:
                _fill(occupied, (solid.corners - low) / RESOLUTION_M)
        percent = np.full((rows, columns), UNKNOWN, np.int8)
        percent[_connected(~occupied, *self._air(low))] = FREE
        percent[occupied] = OCCUPIED
        return OccupancyGrid(RESOLUTION_M, Pose2D(float(low[0]), float(low[1])), percent)

    def _air(self, low: Vector) -> list[tuple[int, int]]:
        """The cells (row, column) from which air spreads."""
        points = [*self.rooms.values(), *self.outside]
        return [(int((y - low[1]) / RESOLUTION_M), int((x - low[0]) / RESOLUTION_M)) for x, y in points]


def _fill(cells: npt.NDArray[np.bool_], corners: Vector) -> None:
    """Set the cells whose middles lie in a convex polygon, given counter-clockwise in cells; in place."""
    left, bottom = np.floor(corners.min(axis=0)).astype(int)
    right, top = np.ceil(corners.max(axis=0)).astype(int)
    x, y = np.meshgrid(np.arange(left, right) + 0.5, np.arange(bottom, top) + 0.5)
    within = np.ones(x.shape, np.bool_)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        within &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0
    cells[bottom:top, left:right] |= within


def _connected(free: npt.NDArray[np.bool_], *seeds: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """The free cells that are connected with a seed: spread along rows and columns until nothing more is reached."""
    reached = np.zeros_like(free)
    for row, column in seeds:
        reached[row, column] = free[row, column]
    count = 0
    while (now := int(reached.sum())) != count:
        count = now
        for turned, open_cells in ((reached, free), (reached.T, free.T)):
            _spread(turned, open_cells)
            _spread(turned[:, ::-1], open_cells[:, ::-1])
    return reached


def _spread(reached: npt.NDArray[np.bool_], free: npt.NDArray[np.bool_]) -> None:
    """Onwards along axis 1, as far as it is free, from each cell that is reached; in place."""
    columns = np.arange(free.shape[1])
    blocked = np.maximum.accumulate(np.where(free, -1, columns), axis=1)
    source = np.maximum.accumulate(np.where(reached, columns, -1), axis=1)
    reached |= free & (source > blocked)
