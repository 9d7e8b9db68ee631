"""Measures the passages ahead: how wide they are between what stands on the left and on the right, scan by scan."""

import math
from typing import Final

import numpy as np

from chefbotd.components.navigation.algorithms.grid import Floats, place_points
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.path import SPACING_M, Path
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record

SPARE_M: Final = 0.06
"""The robot passes what is so much wider than its outline."""

NOISE_M: Final = 0.005
"""What is measured narrower by no more than this may be wide enough: the mean of many scans is as exact as this."""

BEHIND_M, AHEAD_M, BIN_M = -0.35, 0.35, 0.05
"""Where along a heading it is measured, and in what steps."""

ON_PATH_M: Final = 0.25
"""It is measured about the point of the path that is so far ahead, along the path: the robot may stand askew."""

LEAST_POINTS: Final = 3
"""A side with fewer points is not measured."""

PLACE_M: Final = 0.1
"""The measurements of so small a place are of one passage: their mean is exact, each of them is not."""

LEAST_CENTRED: Final = 4
"""The robot steers for the middle of a tight passage after so many measurements,"""

TIGHT_M: Final = 0.1
"""and so much wider than needed it is no tight one."""

BESIDE_PATH_M: Final = 0.1
"""The robot is to drive through a passage whose middle is so near to its path."""

LEAST_MEASURED: Final = 15
"""The mean of so many measurements is believed: a second of a lidar with ten turns a second."""

BESIDE_M: Final = 0.15
"""What stands farther beside the outline than this is no side of a narrow passage."""

SURFACE_M: Final = 0.03
"""The points of one surface differ by so much at most, by their noise."""


class Passage(Record, frozen=True):
    """How wide a place ahead is, where (in the frame of the robot's pose), and how wide the robot needs it."""

    width_m: float
    middle: Pose2D
    needed_m: float

    @property
    def is_too_narrow(self) -> bool:
        """Whether the robot does not pass."""
        return self.width_m < self.needed_m - NOISE_M

    @property
    def is_tight(self) -> bool:
        """Whether the robot passes in the middle only."""
        return self.width_m < self.needed_m + TIGHT_M


def measured_passages(outline: Footprint, walls_m: Floats, pose: Pose2D) -> list[Passage]:
    """The places about a pose, along its heading, that have walls on both sides; points (n, 2), pose and places alike.

    What is less than half as wide as the robot is a wall ahead.
    """
    half_m = float(np.abs(outline.hull[:, 1]).max()) + outline.pad_m
    points = place_points(pose.inverse(), walls_m)
    beside = (points[:, 0] >= BEHIND_M) & (points[:, 0] < AHEAD_M)
    beside &= np.abs(points[:, 1]) < half_m + BESIDE_M
    x, y = points[beside].T
    if not ((y > 0).any() and (y < 0).any()):
        return []
    passages = []
    for begin_m in np.arange(BEHIND_M, AHEAD_M, BIN_M):
        within = (x >= begin_m) & (x < begin_m + BIN_M)
        left_m, right_m = _surface_m(y[within & (y > 0)]), -_surface_m(-y[within & (y < 0)])
        width_m = left_m - right_m
        if half_m < width_m < math.inf:
            middle = pose.compose(Pose2D(float(begin_m) + BIN_M / 2, (left_m + right_m) / 2))
            passages.append(Passage(width_m, middle, 2 * half_m + SPARE_M))
    return passages


def _surface_m(away_m: Floats) -> float:
    """How far the nearest surface is, without the noise of its points; infinite: there is none."""
    if len(away_m) < LEAST_POINTS:
        return math.inf
    away_m = np.sort(away_m)
    return float(away_m[(int(np.searchsorted(away_m, away_m[0] + SURFACE_M, "right")) - 1) // 2])


def _pose_on(path: Path) -> Pose2D:
    k = min(round(ON_PATH_M / SPACING_M), len(path.points_m) - 1)
    x_m, y_m = path.points_m[k]
    return Pose2D(float(x_m), float(y_m), float(path.heading_rad[k]))


class _Place(Record, frozen=True):
    """The sums over all measurements of a place: of its width, and of where its middle is in the grid's frame."""

    width_m: float = 0.0
    x_m: float = 0.0
    y_m: float = 0.0
    count: int = 0

    def added(self, width_m: float, middle: Pose2D) -> "_Place":
        return _Place(self.width_m + width_m, self.x_m + middle.x_m, self.y_m + middle.y_m, self.count + 1)

    def mean(self, needed_m: float) -> Passage:
        return Passage(
            self.width_m / self.count, Pose2D(self.x_m / self.count, self.y_m / self.count), needed_m
        )


class Passages:
    """The passages on the robot's path, in the grid's frame: for each place the mean of all scans so far."""

    def __init__(self) -> None:
        self._places: dict[tuple[int, int], _Place] = {}
        self._stamp_s = -math.inf
        self._ahead: list[tuple[Passage, int]] = []

    def add_scan(self, outline: Footprint, walls_m: Floats, path: Path, stamp_s: float) -> None:
        """Measure what is on the path, by a scan's points of walls (n, 2); the same scan is not measured twice."""
        if stamp_s > self._stamp_s:
            self._stamp_s = stamp_s
            measured = measured_passages(outline, walls_m, _pose_on(path))
            self._ahead = [self._added(passage) for passage in measured]

    def _added(self, passage: Passage) -> tuple[Passage, int]:
        middle = passage.middle
        cell = round(middle.x_m / PLACE_M), round(middle.y_m / PLACE_M)
        place = self._places.get(cell, _Place()).added(passage.width_m, middle)
        self._places[cell] = place
        return place.mean(passage.needed_m), place.count

    def too_narrow(self, path: Path) -> Passage | None:
        """The narrowest one on the path that the robot does not pass, and that was measured often enough; or None."""
        narrow = [
            passage
            for passage, count in self._ahead
            if count >= LEAST_MEASURED
            and passage.is_too_narrow
            and path.away_m(passage.middle) <= BESIDE_PATH_M
        ]
        return min(narrow, key=lambda passage: passage.width_m, default=None)

    def centred(self, path: Path) -> Floats | None:
        """The path's points, moved to the middle of the tight passages that are ahead; None: there are none.

        In a map with cells of 5 cm the path itself is up to 2.5 cm beside the middle.
        """
        tight = [passage for passage, count in self._ahead if count >= LEAST_CENTRED and passage.is_tight]
        if not tight:
            return None
        left = np.stack([-np.sin(path.heading_rad), np.cos(path.heading_rad)], axis=1)
        offsets: dict[int, float] = {}
        for passage in tight:
            apart = np.array([passage.middle.x_m, passage.middle.y_m]) - path.points_m
            k = int(np.argmin(np.hypot(apart[:, 0], apart[:, 1])))
            off_m = float(apart[k] @ left[k])
            is_beside = math.hypot(*apart[k]) - abs(off_m) < SPACING_M  # and not beyond the path's end
            if is_beside and abs(off_m) <= BESIDE_PATH_M:
                offsets[k] = off_m
        if not offsets:
            return None
        at = sorted(offsets)
        beside_m = np.interp(np.arange(len(left)), at, [offsets[k] for k in at])
        points: Floats = path.points_m + left * beside_m[:, None]
        return points


def place_to_close(path: Path, middle: Pose2D, apart_m: float) -> Floats:
    """The point of a path at a passage, or the first behind it that is so far from the path's beginning.

    A place so near that the robot would stand in it closes nothing: it may leave through what is blocked about it.
    """
    points = path.points_m
    at = int(np.argmin(np.hypot(points[:, 0] - middle.x_m, points[:, 1] - middle.y_m)))
    away_m = np.hypot(points[:, 0] - points[0, 0], points[:, 1] - points[0, 1])
    behind = np.flatnonzero(away_m[at:] >= apart_m)
    place: Floats = points[at + int(behind[0])] if len(behind) else points[-1]
    return place
