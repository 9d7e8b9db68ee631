"""Buildings drawn by hand, their maps, and drives through them: independent of the code under test."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from chefbotd.components.localization.algorithms.localizer import LocalizationReport, advance_search, step
from chefbotd.components.localization.algorithms.searching import LocalizationMap
from chefbotd.components.localization.algorithms.state import Localization, Odometry
from chefbotd.components.mapping.algorithms.state import Scan
from chefbotd.components.mapping.algorithms.surfaces import Singles, normals
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from chefbotd.core.poses import between
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, box, wall

CENTER = np.zeros(2)
PERIOD_S = 0.1
MARGIN_M = 0.4


def drawn(walls: Floats, resolution_m: float = 0.05, at: Pose2D | None = None) -> OccupancyGrid:
    """The map of walls (x, y, x, y): cells that a wall passes are occupied, the rest of their extent is free.

    The grid's first corner is a bit beyond the lowest x and y, at no multiple of a cell, unless ``at`` says where.
    """
    placed = at or Pose2D(float(walls[:, ::2].min()) - 0.413, float(walls[:, 1::2].min()) - 0.427)
    cos, sin = math.cos(placed.heading_rad), math.sin(placed.heading_rad)
    turn = np.array([[cos, -sin], [sin, cos]])
    start, end = ((walls[:, k : k + 2] - [placed.x_m, placed.y_m]) @ turn for k in (0, 2))
    size = np.ceil((np.maximum(start, end).max(axis=0) + MARGIN_M) / resolution_m).astype(int)
    percent = np.full((size[1], size[0]), UNKNOWN, np.int8)
    part = np.linspace(0, 1, 2000)[None, :, None]
    cells = np.floor((start[:, None] + part * (end - start)[:, None]) / resolution_m).astype(int)
    low, high = cells.min(axis=(0, 1)), cells.max(axis=(0, 1))
    percent[low[1] : high[1] + 1, low[0] : high[0] + 1] = FREE
    percent[cells[..., 1], cells[..., 0]] = OCCUPIED
    return OccupancyGrid(resolution_m, placed, percent)


def mirrored(grid: OccupancyGrid) -> OccupancyGrid:
    """The same map with left and right exchanged, as an image that was flipped by mistake."""
    flipped = np.ascontiguousarray(grid.percent[:, ::-1])
    return OccupancyGrid(grid.resolution_m, grid.map_from_grid, flipped)


def twin_rooms() -> Floats:
    """Two rooms of 4 by 3 m that are the same but for their place, each with a box, and a corridor that differs."""
    rooms = [
        np.vstack(
            [box(x, 0, 4, 3)[1:2], box(x, 0, 4, 3)[3:], box(x + 0.5, 0.4, 1.1, 0.5), wall((x, 0), (x + 4, 0))]
        )
        for x in (0.0, 4.0)
    ]
    doors = [wall((x, 3), (x + 0.8, 3)) for x in (0.0, 4.0)] + [
        wall((x + 1.7, 3), (x + 4, 3)) for x in (0.0, 4.0)
    ]
    corridor = [wall((0, 3), (0, 4.6), (11, 4.6), (11, 3), (8, 3)), box(9.2, 3.4, 0.6, 0.6, 0.5)]
    return np.vstack([*rooms, *doors, *corridor])


def three_equal_rooms() -> Floats:
    """Three rooms of 3 by 3 m in a row, each with a box, and a corridor along all of them that is closed at its ends."""
    parts = [wall((9, 0), (9, 3)), wall((0, 3), (0, 4.5), (9, 4.5), (9, 3))]
    for x in (0.0, 3.0, 6.0):
        parts += [wall((x, 0), (x, 3)), wall((x, 0), (x + 3, 0)), wall((x, 3), (x + 1.0, 3))]
        parts += [wall((x + 1.9, 3), (x + 3, 3)), box(x + 0.4, 0.4, 0.8, 0.5)]
    return np.vstack(parts)


def corridor_of_mirrored_rooms() -> Floats:
    """A corridor of 14 by 1.8 m with a cupboard, and a room at either end, the one the other's mirror image."""
    return np.vstack(
        [
            wall((0, 0), (14, 0)),
            wall((0, 0), (0, 4), (3, 4), (3, 1.8), (1.9, 1.8)),
            wall((14, 0), (14, 4), (11, 4), (11, 1.8), (12.1, 1.8)),
            wall((0, 1.8), (1.0, 1.8)),
            wall((14, 1.8), (13.0, 1.8)),
            wall((3, 1.8), (11, 1.8)),
            box(0.4, 3.2, 1.0, 0.5),
            box(12.6, 3.2, 1.0, 0.5),
            box(5.6, 0.0, 0.8, 0.35),
        ]
    )


def scan_of(points: Singles) -> Scan:
    """A scan seen from the robot's center."""
    return Scan(points, normals(points, CENTER), CENTER)


@dataclass
class Robot:
    """A robot that localizes: it takes a turn of its lidar every 0.1 s."""

    within: LocalizationMap
    auto_search: bool = True
    now: Localization = field(default_factory=Localization)
    stamp_s: float = 0.0
    reports: list[LocalizationReport] = field(default_factory=list)

    def take(
        self, odometry: Floats, points: Singles | None, covariance: Floats | None = None
    ) -> LocalizationReport:
        """A turn of the lidar, or only odometry; between two turns there is time for some of a search."""
        self.stamp_s += PERIOD_S
        scan = None if points is None else scan_of(points)
        told = Odometry(odometry, covariance)
        self.now, report = step(self.within, self.now, self.stamp_s, told, scan, auto_search=self.auto_search)
        self.now = advance_search(self.within, self.now)
        self.reports.append(report)
        return report

    def drive(self, odometry: Floats, seen: Callable[[int], Singles | None]) -> Iterator[LocalizationReport]:
        """A turn at each pose of the odometry."""
        for k, pose in enumerate(odometry):
            yield self.take(pose, seen(k))

    def look(self, odometry: Floats, seen: Callable[[], Singles], turns: int) -> LocalizationReport:
        """Stand still and look."""
        for _ in range(turns):
            report = self.take(odometry, seen())
        return report


def off(report: LocalizationReport, truth: Floats) -> tuple[float, float]:
    """How far the pose is from the truth, in metres and degrees; infinite if there is none."""
    if report.map_from_base is None:
        return math.inf, math.inf
    error = between(truth, report.map_from_base.pose)
    return math.hypot(error[0], error[1]), abs(math.degrees(error[2]))
