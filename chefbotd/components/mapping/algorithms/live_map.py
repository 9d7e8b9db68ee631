"""The occupancy grid of a growing map, and the updates that are published of it.

Only new scans are traced, as long as no pose has changed. An update has the changed cells, or now and then all of them.
"""

from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.mapping.algorithms.graph import Indices
from chefbotd.components.mapping.algorithms.local_map import Counts
from chefbotd.components.mapping.algorithms.occupancy import Placed, extent_m, percent_of, place_scan, trace
from chefbotd.components.mapping.algorithms.state import Nodes, SlamState
from chefbotd.components.maps.events import MapChanged
from chefbotd.core.geometry import Pose2D
from chefbotd.core.grid_patch import patch_of
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.poses import Floats
from chefbotd.core.record import Record

MARGIN_M = 2.0
"""Room around what was seen, so that the grid does not grow with every scan."""

MOVED_M, MOVED_RAD = 0.005, 0.002
"""If the graph has moved a scan by more, all scans are traced again."""

Percents: TypeAlias = NDArray[np.int8]


class LiveMap(Record, frozen=True):
    """What was traced: the counts of each cell, and which nodes are in them, at which poses.

    ``low_m`` is the outer corner of the first cell, a multiple of the resolution.
    """

    resolution_m: float
    low_m: Floats
    counts: Counts
    numbers: Indices
    poses: Floats


def nothing(resolution_m: float) -> LiveMap:
    """Nothing was traced yet."""
    counts = np.zeros((0, 0, 2), np.uint16)
    return LiveMap(resolution_m, np.zeros(2), counts, np.zeros(0, np.int64), np.zeros((0, 3)))


def update_live_map(live: LiveMap, nodes: Nodes) -> LiveMap:
    """The map with all kept scans of the first part. Uses up ``live``."""
    chosen = np.flatnonzero(nodes.part == 0)
    if not _still_stands(live, nodes.number[chosen], nodes.map[chosen]):
        live = nothing(live.resolution_m)
    new = chosen[len(live.numbers) :]
    scans = [place_scan(nodes.map[k], nodes.scans[k]) for k in new]
    if not scans:
        return live
    live = _with_room(live, scans)
    for scan in scans:
        trace(live.counts, scan.from_m - live.low_m, scan.points_m - live.low_m, live.resolution_m)
    poses = np.vstack([live.poses, nodes.map[new]])
    numbers = np.concatenate([live.numbers, nodes.number[new]])
    return LiveMap(live.resolution_m, live.low_m, live.counts, numbers, poses)


def grid_of(live: LiveMap) -> OccupancyGrid | None:
    """The grid, if there is anything in it."""
    if not live.counts.size:
        return None
    origin = Pose2D(float(live.low_m[0]), float(live.low_m[1]))
    return OccupancyGrid(live.resolution_m, origin, percent_of(live.counts))


def _still_stands(live: LiveMap, numbers: Indices, poses: Floats) -> bool:
    """Whether what was traced is where it was, and is still kept."""
    count = len(live.numbers)
    if count > len(numbers) or not np.array_equal(live.numbers, numbers[:count]):
        return False
    moved = np.abs(live.poses - poses[:count])
    return bool((moved[:, :2] <= MOVED_M).all() and (moved[:, 2] <= MOVED_RAD).all())


def _with_room(live: LiveMap, scans: list[Placed]) -> LiveMap:
    """The same map, with cells for all that these scans show."""
    cell_m, (rows, columns) = live.resolution_m, live.counts.shape[:2]
    low, high = extent_m(scans)
    old_high_m = live.low_m + cell_m * np.array([columns, rows])
    if rows and (low > live.low_m + cell_m).all() and (high < old_high_m - cell_m).all():
        return live
    if rows:
        low, high = np.minimum(low, live.low_m + MARGIN_M), np.maximum(high, old_high_m - MARGIN_M)
    first = np.floor((low - MARGIN_M) / cell_m).astype(np.int64)
    last = np.ceil((high + MARGIN_M) / cell_m).astype(np.int64)
    counts = np.zeros((last[1] - first[1], last[0] - first[0], 2), np.uint16)
    if rows:
        column, row = np.rint(live.low_m / cell_m).astype(np.int64) - first
        counts[row : row + rows, column : column + columns] = live.counts
    low_m = (first * cell_m).astype(np.float64)
    return LiveMap(cell_m, low_m, counts, live.numbers, live.poses)


Rectangle: TypeAlias = tuple[int, int, Percents]
"""A row and a column of a grid, and the cells from there on."""


def changes(before: OccupancyGrid | None, after: OccupancyGrid) -> Rectangle | None:
    """The smallest rectangle with all that is different; the whole grid where its extent is; None: nothing is."""
    same_extent = (
        before is not None
        and before.percent.shape == after.percent.shape
        and before.map_from_grid == after.map_from_grid
        and before.resolution_m == after.resolution_m
    )
    if before is None or not same_extent:
        return 0, 0, after.percent
    different = before.percent != after.percent
    rows, columns = np.flatnonzero(different.any(axis=1)), np.flatnonzero(different.any(axis=0))
    if not rows.size:
        return None
    row, column = int(rows[0]), int(columns[0])
    return row, column, after.percent[row : rows[-1] + 1, column : columns[-1] + 1]


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
        self._live = update_live_map(self._live, state.nodes)
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
