"""Converts a lidar's turn to points: filtered, and corrected for the robot's motion.

A turn takes a tenth of a second, in which a robot moves on by centimetres and turns by degrees. Each beam has its
own time; odometry says where the robot was then.
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters
from chefbotd.core.scan import Floats, LaserScan

Flags: TypeAlias = NDArray[np.bool_]


class BeamParameters(Parameters):
    """Which beams are used; ``blind_sectors_rad`` are spans (from, to) of bearings in the lidar's frame, CCW.

    The robot's own body is a circle about its origin: what ends within is the robot itself.
    """

    min_range_m: float = Field(default=0.05, ge=0, le=100)
    max_range_m: float = Field(default=30.0, gt=0, le=200)
    blind_sectors_rad: tuple[tuple[float, float], ...] = ()
    body_radius_m: float = Field(default=0.0, ge=0, le=5)
    veil_rad: float = Field(default=0.12, ge=0, le=1.5)
    """A point on a line that runs so nearly along its beam is no surface, but between an edge and what is behind."""

    @model_validator(mode="after")
    def _has_a_band(self) -> "BeamParameters":
        if self.min_range_m >= self.max_range_m:
            raise ValueError(
                f"min_range_m must be below max_range_m, got {self.min_range_m} and {self.max_range_m}"
            )
        return self


@dataclass(frozen=True, slots=True)
class Track:
    """Where odometry says the robot was: times (rising) and poses (n, 3: x, y, heading), one at least."""

    stamp_s: Floats
    odom_from_base: Floats


def usable(params: BeamParameters, scan: LaserScan) -> Flags:
    """Which beams have a reading that can be trusted."""
    ranges = np.where(np.isfinite(scan.range_m), scan.range_m, 0.0)
    good: Flags = (ranges >= params.min_range_m) & (ranges <= params.max_range_m) & (ranges > 0)
    for begin, end in params.blind_sectors_rad:
        good = np.logical_and(good, outside(scan.bearing_rad, begin, end))
    return np.logical_and(good, ~_veils(scan.bearing_rad, ranges, params.veil_rad))


def outside(bearing_rad: Floats, begin_rad: float, end_rad: float) -> Flags:
    """Which bearings are not in the sector that goes counter-clockwise from its begin to its end."""
    return np.asarray((bearing_rad - begin_rad) % math.tau > (end_rad - begin_rad) % math.tau, np.bool_)


def _veils(bearing_rad: Floats, range_m: Floats, veil_rad: float) -> Flags:
    """Points between an edge and what is behind it: the beam hit both, and the lidar says something in between.

    The lines to both neighbours run along the beam, one towards the sensor, the other away.
    """
    found = np.zeros(len(range_m), np.bool_)
    if len(range_m) < 3:
        return found
    across = np.abs(np.sin(np.diff(bearing_rad))) * np.minimum(range_m[1:], range_m[:-1])
    along = np.diff(range_m)
    steep = np.abs(np.arctan2(across, np.abs(along))) < veil_rad
    deep = np.abs(along) > 0.05
    step = steep & deep & (range_m[1:] > 0) & (range_m[:-1] > 0)
    found[1:-1] = step[1:] & step[:-1] & (along[1:] * along[:-1] > 0)
    return found


def points_in_base(params: BeamParameters, base_from_lidar: Pose2D, scan: LaserScan, track: Track) -> Floats:
    """What the usable beams hit, (n, 2) in the robot's frame at the scan's stamp, in the order of the beams."""
    good = np.flatnonzero(usable(params, scan))
    bearing, ranges = scan.bearing_rad[good], scan.range_m[good]
    there = np.stack([ranges * np.cos(bearing), ranges * np.sin(bearing)], axis=1)
    mount = np.array([base_from_lidar.x_m, base_from_lidar.y_m, base_from_lidar.heading_rad])
    then = placed(mount, there)
    if params.body_radius_m > 0:
        beyond = np.hypot(then[:, 0], then[:, 1]) > params.body_radius_m
        then, good = then[beyond], good[beyond]
    poses = pose_at(track, scan.stamp_s + scan.after_s[good])
    in_odom = placed(poses, then)
    return seen_from(pose_at(track, np.array([scan.stamp_s]))[0], in_odom)


def pose_at(track: Track, stamp_s: Floats) -> Floats:
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
