"""Joins several lidars into one scan: which turns belong together, and from where each point was seen.

Lidars turn as they like, each in its own time. Whatever waits for all of them waits for the slowest, or for one that is
dead. So one of them leads: each of its turns is a scan at its own time, with the newest turn of every other one. What
the robot moved in between is undone by odometry, as it is within a turn.
"""

import math
from collections.abc import Sequence
from typing import Final, Generic, TypeVar

import numpy as np

from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.scan import Floats
from chefbotd.perception.laser_scan import OdometryTrack, placed, points_in_base, pose_at, seen_from

SILENT_S: Final = 0.5
"""A lidar whose last turn is older than another's by so much leads no more."""

TOGETHER_S: Final = 0.3
"""Turns that are further apart are not joined: an RPLIDAR A1 takes 0.18 s for one."""

T = TypeVar("T")


class ScanAssembler(Generic[T]):
    """Turns in, in the order in which they come; out come those that make one scan, the leading one first.

    The first of ``lidars`` that is not silent leads. Each turn is used once. No clock is asked: stamps are compared.
    """

    def __init__(self, lidars: Sequence[str]) -> None:
        self._lidars = tuple(lidars)
        self._last_s: dict[str, float] = {}
        self._waiting: dict[str, tuple[float, T]] = {}

    def add_turn(self, lidar: str, stamp_s: float, turn: T) -> tuple[T, ...]:
        """The turns that make a scan with this one; none where it does not lead, or is no lidar's of these."""
        if lidar not in self._lidars:
            return ()
        if math.isfinite(stamp_s):
            self._last_s[lidar] = stamp_s
        if lidar != self._leading(stamp_s, lidar):
            self._waiting[lidar] = (stamp_s, turn)
            return ()
        waiting, self._waiting = self._waiting, {}
        others = [waiting[name] for name in self._lidars if name in waiting and name != lidar]
        return (turn, *(other for at_s, other in others if abs(stamp_s - at_s) <= TOGETHER_S))

    def clear(self) -> None:
        """Forget the turns that wait for the leading lidar."""
        self._waiting.clear()

    def _leading(self, now_s: float, present: str) -> str:
        """Who leads, at the time of a turn of the lidar ``present``."""
        heard = (name for name in self._lidars if abs(now_s - self._last_s.get(name, -math.inf)) <= SILENT_S)
        return next(heard, present)


def joined_points(
    band_m: tuple[float, float], turns: Sequence[ScanMeasured], track: OdometryTrack
) -> tuple[Floats, Floats]:
    """What the turns show, in the robot's frame at the time of the first one; there must be one turn at least.

    The points (n, 2) are lidar by lidar in the order of the beams. With them comes where they were seen from: one place
    (2,) of one lidar, or one for each point (n, 2).
    """
    first, mount = turns[0], turns[0].base_from_lidar
    if len(turns) == 1:
        return points_in_base(band_m, mount, first.scan, track), np.array([mount.x_m, mount.y_m])
    now = pose_at(track, np.array([first.scan.stamp_s]))[0]
    points, sensors = [], []
    for turn in turns:
        mount, scan = turn.base_from_lidar, turn.scan
        then = pose_at(track, np.array([scan.stamp_s]))[0]
        seen = placed(then, points_in_base(band_m, mount, scan, track))
        sensor = placed(then, np.array([[mount.x_m, mount.y_m]]))
        points.append(seen_from(now, seen))
        sensors.append(np.repeat(seen_from(now, sensor), len(seen), axis=0))
    return np.concatenate(points), np.concatenate(sensors)
