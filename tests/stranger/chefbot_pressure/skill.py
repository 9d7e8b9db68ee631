"""Its skill in the worker: how far the robot has driven. The parameters are the section as JSON."""

import json
import math
from collections.abc import Iterable
from typing import Any

from chefbotd.core.record import Record


class DistanceDriven(Record, frozen=True):
    """How far the robot has driven."""

    stamp_s: float
    distance_m: float


class DistanceSkill:
    """Adds up what odometry says."""

    def __init__(self, parameters: bytes, clock: Any) -> None:
        self._period_s = json.loads(parameters)["period_s"]
        self._last: Any = None
        self._distance_m = self._told_s = 0.0

    def warm(self) -> None:
        """Nothing is compiled."""

    def take_scan(self, scan: Any) -> Iterable[Any]:
        """Scans tell nothing about it."""
        return ()

    def take_odometry(self, odometry: Any) -> Iterable[Any]:
        """Add a step."""
        pose, last, self._last = odometry.odom_from_base, self._last, odometry.odom_from_base
        if last is not None:
            self._distance_m += math.hypot(pose.x_m - last.x_m, pose.y_m - last.y_m)
        if odometry.stamp_s >= self._told_s + self._period_s:
            self._told_s = odometry.stamp_s
            yield DistanceDriven(odometry.stamp_s, self._distance_m)

    def handle(self, body: bytes) -> None:
        """Nothing can be asked."""

    def step(self, now_s: float) -> Iterable[Any]:
        """Nothing has its own time."""
        return ()

    def close(self) -> None:
        """Nothing is kept."""
