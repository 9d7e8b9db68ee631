"""The input of mapping and localization: scans that are corrected for the robot's motion, and how long none has come.

A scan is corrected once its odometry has arrived; those of several lidars are joined.
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import islice
from typing import Final

import numpy as np

from chefbotd.components.mapping.algorithms.state import Scan
from chefbotd.components.mapping.algorithms.surfaces import normals
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import MapPoseUpdated, OdometryUpdated
from chefbotd.core.geometry import Pose2D, PoseCovariance
from chefbotd.core.poses import Floats
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence, join_sentences
from chefbotd.perception.laser_scan import OdometryTrack, ScanAssembler, joined_points, pose_at

SILENT_S: Final = 2.0
"""After so long without scans, or without odometry, it is said."""

EXCUSED_S: Final = 1.0
"""Who has not looked for so long was busy, or asleep, and does not know what came meanwhile."""


class Silence:
    """What is missing, in words (``problem``; empty: nothing). ``scan_s`` and ``odometry_s`` are when the last one came.

    Each lidar is named by itself. ``leaves_nothing``: not one of them is left, or no odometry.
    """

    def __init__(self, lidars: Sequence[str]) -> None:
        self.scan_s = dict.fromkeys(lidars, float("-inf"))
        self.odometry_s = float("-inf")
        self._awaited_s: float | None = None
        self._looked_s = float("-inf")
        self.problem = ""
        self.leaves_nothing = False

    def has_changed(self, now_s: float, *, is_awaited: bool) -> bool:
        """Look again: whether ``problem`` is another one now, which it is once a second while something is missing."""
        if not is_awaited:
            self._awaited_s = None
        elif self._awaited_s is None or now_s - self._looked_s > EXCUSED_S:
            self._awaited_s = now_s
        self._looked_s, before = now_s, self.problem
        self.leaves_nothing = False
        self.problem = "" if self._awaited_s is None else self._missing(now_s, self._awaited_s)
        return self.problem != before

    def _missing(self, now_s: float, since_s: float) -> str:
        heard_s = max(self.scan_s.values(), default=since_s)
        self.leaves_nothing = now_s - max(min(heard_s, self.odometry_s), since_s) >= SILENT_S
        missing = [
            Sentence(
                "mapping.no_scan",
                "no scan of the lidar {name!r} for {seconds} s",
                name=name,
                seconds=int(waited_s),
            )
            for name, at_s in self.scan_s.items()
            if (waited_s := now_s - max(at_s, since_s)) >= SILENT_S
        ]
        without_s = now_s - max(self.odometry_s, since_s)
        if without_s >= SILENT_S:
            missing.append(
                Sentence("mapping.no_odometry", "no odometry for {seconds} s", seconds=int(without_s))
            )
        return join_sentences(missing)


KEPT_S: Final = 2.0
"""Odometry is remembered for so long; a turn takes a tenth of a second."""

MOST_WAITING: Final = 5
PATIENCE_S: Final = 0.25
"""A scan that is older goes on without newer odometry: that is held, and a robot without encoders stands (safety.md)."""

BAND_M: Final = (0.01, 90.0)
"""The lidar's own range and its blind sectors were taken out before."""


class AlignedScan(Record, frozen=True):
    """What a turn shows, in the robot's frame at ``stamp_s``, and where odometry says that it was then.

    ``odometry_covariance`` (3, 3) is that of the last odometry which is no later.
    """

    stamp_s: float
    odometry: Floats
    odometry_covariance: Floats
    scan: Scan


class ScanAligner:
    """Scans and odometry in, aligned scans out, in the order of their stamps.

    The turns of all ``lidars`` that belong together make one scan. A turn of another lidar, or of a time that is not
    finite, is passed over.
    """

    def __init__(self, lidars: Sequence[str]) -> None:
        self._assembler: ScanAssembler[ScanMeasured] = ScanAssembler(lidars)
        self._track: deque[OdometryUpdated] = deque()
        self._waiting: deque[tuple[ScanMeasured, ...]] = deque()

    def add_odometry(self, odometry: OdometryUpdated) -> None:
        """Remember where odometry says the robot is; what is not newer than the last, or not finite, is passed over."""
        track = self._track
        if not all(map(math.isfinite, _row(odometry))) or (track and odometry.stamp_s <= track[-1].stamp_s):
            return
        track.append(odometry)
        while track[0].stamp_s < odometry.stamp_s - KEPT_S:
            track.popleft()

    def add_scan(self, scan: ScanMeasured) -> None:
        """Keep a scan until it can be aligned; of too many that wait the oldest gives way."""
        if not math.isfinite(scan.stamp_s):
            return
        turns = self._assembler.add_turn(scan.lidar, scan.stamp_s, scan)
        if turns:
            self._waiting.append(turns)
        if len(self._waiting) > MOST_WAITING:
            self._waiting.popleft()

    def forget_scans(self) -> None:
        """Forget the scans that wait."""
        self._waiting.clear()
        self._assembler.clear()

    def next_aligned(self, now_s: float) -> AlignedScan | None:
        """The next scan for which there is odometry, or for which none is waited any more; None: there is none."""
        while self._waiting and self._track:
            turns = self._waiting[0]
            scan = turns[0]
            if self._track[-1].stamp_s < scan.stamp_s and now_s - scan.stamp_s < PATIENCE_S:
                return None
            self._waiting.popleft()
            if self._track[0].stamp_s > scan.stamp_s:
                continue  # where the robot was then was forgotten, or never known
            return self._aligned(turns)
        return None

    def _aligned(self, turns: tuple[ScanMeasured, ...]) -> AlignedScan:
        track = self._track_from(min(turn.stamp_s + turn.scan.after_s.min(initial=0.0) for turn in turns))
        points_m, sensor_m = joined_points(BAND_M, turns, track)
        points, stamp_s = points_m.astype(np.float32), turns[0].stamp_s
        pose = pose_at(track, np.array([stamp_s]))[0]
        sensor_m = sensor_m if sensor_m.ndim == 1 else sensor_m.astype(np.float32)
        last = next((one for one in reversed(self._track) if one.stamp_s <= stamp_s), self._track[0])
        covariance = np.reshape(last.covariance.row_by_row, (3, 3))
        return AlignedScan(stamp_s, pose, covariance, Scan(points, normals(points, sensor_m), sensor_m))

    def _track_from(self, begin_s: float) -> OdometryTrack:
        """Where the robot was, from the last that was known by then on."""
        newest = len(self._track) - 1
        first = next((k for k in range(newest, 0, -1) if self._track[k].stamp_s <= begin_s), 0)
        rows = np.array([_row(odometry) for odometry in islice(self._track, first, None)])
        return OdometryTrack(rows[:, 0], rows[:, 1:])


def _row(odometry: OdometryUpdated) -> tuple[float, float, float, float]:
    """Its time, x, y and heading."""
    pose = odometry.odom_from_base
    return odometry.stamp_s, pose.x_m, pose.y_m, pose.heading_rad


def pose_updated(
    stamp_s: float,
    map_pose: Floats,
    odometry: Floats,
    covariance: Floats,
    fit: float,
    state: str,
    searched: float = 0.0,
    of_map: str | None = None,
) -> MapPoseUpdated:
    """Where the robot was in the map; ``odom`` is the frame of the odometry that the worker is sent."""
    map_from_base = pose_of(map_pose)
    c = covariance.tolist()
    return MapPoseUpdated(
        stamp_s,
        map_from_base,
        map_from_base.compose(pose_of(odometry).inverse()),
        PoseCovariance(c[0][0], c[0][1], c[0][2], c[1][1], c[1][2], c[2][2]),
        fit,
        state,
        searched,
        of_map,
    )


def pose_of(pose: Floats) -> Pose2D:
    """Three numbers as a pose."""
    x_m, y_m, heading_rad = pose.tolist()
    return Pose2D(x_m, y_m, heading_rad)
