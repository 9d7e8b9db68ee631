"""Converts a lidar's turn to points: filtered, and corrected for the robot's motion.

A turn takes a tenth of a second, in which a robot moves on by centimetres and turns by degrees. Each beam has its
own time; odometry says where the robot was then.

Several lidars are joined into one scan. They turn as they like, each in its own time. Whatever waits for all of them
waits for the slowest, or for one that is dead. So one of them leads: each of its turns is a scan at its own time, with
the newest turn of every other one. What the robot moved in between is undone by odometry, as it is within a turn.
"""

import math
from collections.abc import Sequence
from typing import Final, Generic, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record
from chefbotd.core.scan import Floats, LaserScan

Flags: TypeAlias = NDArray[np.bool_]


VEIL_RAD: Final = 0.12
"""A point on a line that runs so nearly along its beam is no surface, but between an edge and what is behind.

Such shadow points are what the ScanShadowsFilter of ROS's laser_filters removes, too.
"""


class OdometryTrack(Record, frozen=True):
    """Where odometry says the robot was: times (rising) and poses (n, 3: x, y, heading), one at least."""

    stamp_s: Floats
    odom_from_base: Floats


def usable(band_m: tuple[float, float], scan: LaserScan) -> Flags:
    """Which beams have a reading that can be trusted: from the nearest to the farthest range, and no veil."""
    ranges = np.where(np.isfinite(scan.range_m), scan.range_m, 0.0)
    good: Flags = (ranges >= band_m[0]) & (ranges <= band_m[1]) & (ranges > 0)
    return np.logical_and(good, ~_veils(scan.bearing_rad, ranges))


def _veils(bearing_rad: Floats, range_m: Floats) -> Flags:
    """Points between an edge and what is behind it: the beam hit both, and the lidar says something in between.

    The lines to both neighbours run along the beam, one towards the sensor, the other away.
    """
    veils = np.zeros(len(range_m), np.bool_)
    if len(range_m) < 3:
        return veils
    across = np.abs(np.sin(np.diff(bearing_rad))) * np.minimum(range_m[1:], range_m[:-1])
    along = np.diff(range_m)
    steep = np.abs(np.arctan2(across, np.abs(along))) < VEIL_RAD
    deep = np.abs(along) > 0.05
    step = steep & deep & (range_m[1:] > 0) & (range_m[:-1] > 0)
    veils[1:-1] = step[1:] & step[:-1] & (along[1:] * along[:-1] > 0)
    return veils


def points_in_base(
    band_m: tuple[float, float], base_from_lidar: Pose2D, scan: LaserScan, track: OdometryTrack
) -> Floats:
    """What the usable beams hit, (n, 2) in the robot's frame at the scan's stamp, in the order of the beams."""
    good = np.flatnonzero(usable(band_m, scan))
    bearing, ranges = scan.bearing_rad[good], scan.range_m[good]
    points = np.stack([ranges * np.cos(bearing), ranges * np.sin(bearing)], axis=1)
    mount = np.array([base_from_lidar.x_m, base_from_lidar.y_m, base_from_lidar.heading_rad])
    then = place_points(mount, points)
    poses = pose_at(track, scan.stamp_s + scan.after_s[good])
    in_odom = place_points(poses, then)
    return seen_from(pose_at(track, np.array([scan.stamp_s]))[0], in_odom)


def pose_at(track: OdometryTrack, stamp_s: Floats) -> Floats:
    """Where the robot was at these times (n, 3): straight between two poses, and held beyond the first and last."""
    heading = np.unwrap(track.odom_from_base[:, 2])
    columns = [track.odom_from_base[:, 0], track.odom_from_base[:, 1], heading]
    return np.stack([np.interp(stamp_s, track.stamp_s, column) for column in columns], axis=1)


def place_points(pose: Floats, points: Floats) -> Floats:
    """Points of the pose's frame in the frame it is given in; one pose, or one for each point."""
    cos, sin = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    x = pose[..., 0] + cos * points[:, 0] - sin * points[:, 1]
    y = pose[..., 1] + sin * points[:, 0] + cos * points[:, 1]
    return np.stack([x, y], axis=1)


def seen_from(pose: Floats, points: Floats) -> Floats:
    """Points as seen from a pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = points[:, 0] - pose[0], points[:, 1] - pose[1]
    return np.stack([cos * dx + sin * dy, cos * dy - sin * dx], axis=1)


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
        seen = place_points(then, points_in_base(band_m, mount, scan, track))
        sensor = place_points(then, np.array([[mount.x_m, mount.y_m]]))
        points.append(seen_from(now, seen))
        sensors.append(np.repeat(seen_from(now, sensor), len(seen), axis=0))
    return np.concatenate(points), np.concatenate(sensors)
