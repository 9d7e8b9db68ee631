"""Converts a lidar's turn to points: filtered, and corrected for the robot's motion.

A turn takes a tenth of a second, in which a robot moves on by centimetres and turns by degrees. Each beam has its
own time; odometry says where the robot was then.
"""

import math
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

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
    then = placed(mount, points)
    poses = pose_at(track, scan.stamp_s + scan.after_s[good])
    in_odom = placed(poses, then)
    return seen_from(pose_at(track, np.array([scan.stamp_s]))[0], in_odom)


def pose_at(track: OdometryTrack, stamp_s: Floats) -> Floats:
    """Where the robot was at these times (n, 3): straight between two poses, and held beyond the first and last."""
    heading = np.unwrap(track.odom_from_base[:, 2])
    columns = [track.odom_from_base[:, 0], track.odom_from_base[:, 1], heading]
    return np.stack([np.interp(stamp_s, track.stamp_s, column) for column in columns], axis=1)


def placed(pose: Floats, points: Floats) -> Floats:
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
