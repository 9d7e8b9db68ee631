"""The updates of a growing map: the changed cells, from time to time all cells, and the robot's pose."""

import zlib
from typing import Final

import numpy as np

from chefbotd.mapping.live_map import Patch, changes, grid_of, nothing, updated
from chefbotd.mapping.occupancy_grid import OccupancyGrid
from chefbotd.mapping.poses import Floats
from chefbotd.mapping.slam import Report
from chefbotd.mapping.state import SlamState
from chefbotd.worker.skills.aligned_scans import AlignedScan
from chefbotd.worker.skills.mapping_messages import GridPart, PoseFound

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

    def changes(self, now_s: float, state: SlamState) -> GridPart | None:
        """The cells that have changed since the last update, or after a while all of them; None: nothing has changed."""
        before, self.number = self.grid, state.next_number
        self._live = updated(self._live, state.nodes)
        self.grid = grid_of(self._live)
        if self.grid is None:
            return None
        is_whole_due = now_s >= self._whole_at_s
        patch = _all_of(self.grid) if is_whole_due else changes(before, self.grid)
        if patch is None:
            return None
        self._revision += 1
        if patch.whole:
            self._whole_at_s = now_s + WHOLE_EVERY_S
        return self._part(now_s, self.grid, patch)

    def whole(self, now_s: float) -> GridPart | None:
        """All cells, as of the last update; None: nothing is in the map yet."""
        return None if self.grid is None else self._part(now_s, self.grid, _all_of(self.grid))

    def _part(
        self,
        stamp_s: float,
        grid: OccupancyGrid,
        patch: Patch,
    ) -> GridPart:
        origin, (rows, columns) = grid.map_from_grid, grid.percent.shape
        return GridPart(
            stamp_s=stamp_s,
            revision=self._revision,
            resolution_m=grid.resolution_m,
            origin=(origin.x_m, origin.y_m, origin.heading_rad),
            columns=columns,
            rows=rows,
            column=patch.column,
            row=patch.row,
            part_columns=patch.percent.shape[1],
            part_rows=patch.percent.shape[0],
            whole=patch.whole,
            cells=zlib.compress(np.ascontiguousarray(patch.percent).tobytes(), 1),
        )


def _all_of(grid: OccupancyGrid) -> Patch:
    return Patch(0, 0, grid.percent, whole=True)


def pose_found(aligned: AlignedScan, report: Report) -> PoseFound:
    """The robot's pose at the scan's last beam."""
    c = report.covariance
    upper = (c[0, 0], c[0, 1], c[0, 2], c[1, 1], c[1, 2], c[2, 2])
    return PoseFound(
        stamp_s=aligned.stamp_s,
        map_from_base=_triple(report.map_pose),
        odometry=_triple(aligned.odometry),
        covariance=tuple(float(value) for value in upper),  # type: ignore[arg-type]
        fit=report.fit,
        state=str(report.mode),
    )


def way_m(state: SlamState) -> float:
    """The way from kept scan to kept scan; SLAM's own ``path_m`` counts turning too."""
    nodes = state.nodes
    steps = np.diff(nodes.local[:, :2], axis=0)[
        np.diff(nodes.part) == 0
    ]  # between two parts nothing is known
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def _triple(pose: Floats) -> tuple[float, float, float]:
    return float(pose[0]), float(pose[1]), float(pose[2])
