"""The free floor around the robot, by what its lidars see."""

import math
from collections.abc import Iterable

import numpy as np

from chefbotd.components.calibration.algorithms.step import ConfiguredRobot
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.record import Record
from chefbotd.core.scan import Floats
from chefbotd.perception.laser_scan import usable

LEAST_POINTS = 3
"""So many points are something; fewer may be dust or noise."""


class FreeSpace(Record, frozen=True):
    """How far the nearest thing is from the robot's outline, and in which direction (CCW from ahead)."""

    distance_m: float
    bearing_rad: float

    def __str__(self) -> str:
        side = ("ahead", "left", "behind", "right")[round(self.bearing_rad / (math.pi / 2)) % 4]
        return f"{self.distance_m:.2f} m, {side}"


def free_space(robot: ConfiguredRobot, scans: Iterable[ScanMeasured]) -> FreeSpace | None:
    """The free floor around the outline by the newest scan of each lidar; None where none sees anything."""
    newest = {scan.lidar: scan for scan in scans}
    points = [_points(robot, scan) for scan in newest.values()]
    everything = np.concatenate(points, axis=1) if points else np.empty((2, 0))
    distances = np.hypot(*everything)
    outside = distances > robot.outline_radius_m  # what is nearer is the robot's own body
    if np.count_nonzero(outside) < LEAST_POINTS:
        return None
    order = np.argsort(distances[outside])
    nearest = everything[:, outside][:, order[LEAST_POINTS - 1]]
    distance_m = float(np.hypot(*nearest)) - robot.outline_radius_m
    return FreeSpace(distance_m, math.atan2(nearest[1], nearest[0]))


def _points(robot: ConfiguredRobot, measured: ScanMeasured) -> Floats:
    """The readings in the base's frame, 2 x N."""
    lidar = next((one for one in robot.lidars if one.name == measured.lidar), None)
    if lidar is None:
        return np.empty((2, 0))
    scan, mount = measured.scan, lidar.base_from_lidar
    used = usable(lidar.band_m, scan)
    bearing_rad, range_m = scan.bearing_rad[used] + mount.heading_rad, scan.range_m[used]
    return np.array([mount.x_m + range_m * np.cos(bearing_rad), mount.y_m + range_m * np.sin(bearing_rad)])
