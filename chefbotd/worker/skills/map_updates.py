"""The updates of a growing map: the changed cells, from time to time all cells, and the robot's pose."""

from typing import Final

import numpy as np

from chefbotd.core.events.mapping import MapChanged
from chefbotd.core.grid_patch import patch_of
from chefbotd.mapping.live_map import Rectangle, changes, grid_of, nothing, updated
from chefbotd.mapping.occupancy_grid import OccupancyGrid
from chefbotd.mapping.state import SlamState

WHOLE_EVERY_S: Final = 10.0
"""Whoever has begun to listen late, or has missed a part, has the whole map after so long."""


class MapUpdates:
    """Updates are numbered by one count for all maps. ``number`` is that of the last scan in them."""

    def __init__(self, resolution_m: float) -> None:
        self._resolution_m, self._revision = resolution_m, 0
        self.forget()

    def forget(self) -> None:
        """No map is being made."""
        self._live = nothing(self._resolution_m)
        self.grid: OccupancyGrid | None = None
        self.number = 0
        self._whole_at_s = float("-inf")

    def changes(self, now_s: float, state: SlamState) -> MapChanged | None:
        """The cells that have changed since the last update, or after a while all of them; None: nothing has changed."""
        before, self.number = self.grid, state.next_number
        self._live = updated(self._live, state.nodes)
        self.grid = grid_of(self._live)
        if self.grid is None:
            return None
        is_whole_due = now_s >= self._whole_at_s
        changed = _all_of(self.grid) if is_whole_due else changes(before, self.grid)
        if changed is None:
            return None
        self._revision += 1
        patch = self._patch(now_s, self.grid, changed)
        if patch.whole:
            self._whole_at_s = now_s + WHOLE_EVERY_S
        return patch

    def whole(self, now_s: float) -> MapChanged | None:
        """All cells, as of the last update; None: nothing is in the map yet."""
        return None if self.grid is None else self._patch(now_s, self.grid, _all_of(self.grid))

    def _patch(self, stamp_s: float, grid: OccupancyGrid, changed: Rectangle) -> MapChanged:
        row, column, percent = changed
        rows, columns = grid.percent.shape
        return patch_of(
            MapChanged,
            percent,
            row,
            column,
            stamp_s=stamp_s,
            revision=self._revision,
            resolution_m=grid.resolution_m,
            map_from_grid=grid.map_from_grid,
            columns=columns,
            rows=rows,
            whole=percent.shape == grid.percent.shape,
        )


def _all_of(grid: OccupancyGrid) -> Rectangle:
    return 0, 0, grid.percent


def way_m(state: SlamState) -> float:
    """The way from kept scan to kept scan; SLAM's own ``path_m`` counts turning too."""
    nodes = state.nodes
    steps = np.diff(nodes.local[:, :2], axis=0)[
        np.diff(nodes.part) == 0
    ]  # between two parts nothing is known
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum())
