"""What a lidar's scan says, as arrays."""

import numpy as np
import numpy.typing as npt

from chefbotd.client.models import ScanData

Array = npt.NDArray[np.float64]


def points_of(scan: ScanData) -> Array:
    """The points that the lidar saw, in the robot's frame: x ahead and y to the left, in metres; shape (count, 2)."""
    ranges_m = np.array(scan.range_mm, np.float64) / 1000.0
    if scan.bearing_mrad is None:
        step_rad, numbers = scan.bearing_step_rad or 0.0, np.arange(len(ranges_m), dtype=np.float64)
        bearings = np.add(scan.bearing_start_rad, step_rad * numbers)
    else:
        bearings = np.array([mrad / 1000.0 for mrad in scan.bearing_mrad], np.float64)
    angles = scan.yaw_rad + bearings
    x_m, y_m = scan.x_m + ranges_m * np.cos(angles), scan.y_m + ranges_m * np.sin(angles)
    return np.column_stack((x_m, y_m))[ranges_m > 0]


def nearest_m(points: Array, sectors: int) -> Array:
    """The distance of the nearest point in each of equal sectors, CCW from straight ahead; 10 m where there is none."""
    distances = np.hypot(points[:, 0], points[:, 1])
    angles = np.arctan2(points[:, 1], points[:, 0])
    numbers = np.round(angles / (2 * np.pi / sectors)).astype(int) % sectors
    nearest = np.full(sectors, 10.0)
    np.minimum.at(nearest, numbers, distances)
    return nearest
