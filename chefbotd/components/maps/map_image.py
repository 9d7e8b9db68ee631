"""A map's cells as a client has them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chefbotd.core.record import Record

if TYPE_CHECKING:
    from chefbotd.core.occupancy_grid import OccupancyGrid


class MapImage(Record, frozen=True):
    """A map's cells: a signed byte each, row by row, the lowest row first; -1 unknown, 0 free, 100 occupied.

    (``x_m``, ``y_m``, ``heading_rad``) is where the outer corner of the first cell lies in ``map``. A map that is being
    made has no ``saved_at_s``, no name unless it goes on with a stored one, and counts its changes as ``version``.
    """

    name: str | None
    version: int
    saved_at_s: float | None
    resolution_m: float
    columns: int
    rows: int
    x_m: float
    y_m: float
    heading_rad: float
    cells: bytes

    def grid(self) -> OccupancyGrid:
        """The same for numpy, as the packages for mapping and planning use it."""
        import numpy as np

        from chefbotd.core.geometry import Pose2D
        from chefbotd.core.occupancy_grid import OccupancyGrid

        percent = np.frombuffer(self.cells, np.int8).reshape(self.rows, self.columns)
        return OccupancyGrid(self.resolution_m, Pose2D(self.x_m, self.y_m, self.heading_rad), percent)
