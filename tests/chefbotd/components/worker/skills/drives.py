"""A drive through the simulated flat, as the worker gets it: scans and odometry with their times."""

import math
from collections.abc import Iterator

import numpy as np

from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import OdometryUpdated
from chefbotd.core.geometry import CERTAIN, Pose2D, Twist2D
from chefbotd.core.scan import LaserScan
from tests.chefbotd.components.mapping.algorithms.slam.flat import (
    TOUR,
    Floats,
    cast,
    furnished_flat,
    odometry,
    poses_along,
)

BEAMS, PERIOD_S = 240, 0.1
MOUNT = Pose2D(0.07, -0.02, 0.4)
"""Beside the robot's middle, and turned."""

TRUTH = poses_along(TOUR)


def turn(
    stamp_s: float, lidar: str, base_from_lidar: Pose2D, bearings: Floats, ranges: Floats
) -> ScanMeasured:
    """A turn that took no time, in the single precision in which it goes over the wire."""
    arrays = [values.astype("<f4").astype(float) for values in (bearings, ranges, np.zeros(len(bearings)))]
    return ScanMeasured(stamp_s, lidar, base_from_lidar, LaserScan(stamp_s, *arrays))


def moving(stamp_s: float, pose: Floats, speed_m_s: float = 0.1) -> OdometryUpdated:
    """Odometry of a robot that drives straight ahead."""
    return OdometryUpdated(stamp_s, stamp_s, Pose2D(*map(float, pose)), Twist2D(speed_m_s), CERTAIN)


FRONT_AND_REAR = (("front", Pose2D(0.16, 0.03, 0.2)), ("rear", Pose2D(-0.17, -0.02, 2.9)))
"""Two lidars, each blind behind itself."""

REAR_LATE_S = 0.0595
"""So long before the front one's turn the rear one's ended: half a step of the tour, as odometry has it."""


def measured_by_two(
    first: int, last: int, seed: int = 1, begin_s: float = 50.0
) -> Iterator[ScanMeasured | OdometryUpdated]:
    """The tour seen by two lidars that look 110 degrees to either side; the rear one's turns end half a step before."""
    walls, chance = furnished_flat(), np.random.default_rng(seed)
    bearings = np.linspace(-1.92, 1.92, BEAMS // 2)
    driven = odometry(TRUTH, seed)
    for k in range(max(first, 1), last):
        stamp_s = begin_s + PERIOD_S * k
        turns = zip(
            FRONT_AND_REAR,
            (TRUTH[k], (TRUTH[k - 1] + TRUTH[k]) / 2),
            (stamp_s, stamp_s - REAR_LATE_S),
            strict=True,
        )
        front, rear = [
            turn(at_s, name, mount, bearings, seen)
            for (name, mount), pose, at_s in turns
            for seen in [_ranges(walls, chance, pose, mount, bearings)]
        ]
        yield rear
        yield moving(stamp_s - 0.02, driven[k])
        yield front
        yield moving(stamp_s + 0.001, driven[k])


def _ranges(
    walls: Floats,
    chance: np.random.Generator,
    pose: Floats,
    mount: Pose2D,
    bearings: Floats,
) -> Floats:
    x, y, heading = pose
    at_x = x + mount.x_m * math.cos(heading) - mount.y_m * math.sin(heading)
    at_y = y + mount.x_m * math.sin(heading) + mount.y_m * math.cos(heading)
    ranges = cast(walls, np.array([at_x, at_y, heading + mount.heading_rad]), np.zeros((0, 3)), bearings)
    return np.where(ranges < 12.0, ranges + chance.normal(0, 0.01, len(bearings)), 0.0)


def measured(
    first: int, last: int, seed: int = 1, begin_s: float = 50.0
) -> Iterator[ScanMeasured | OdometryUpdated]:
    """Scans ``first`` to ``last`` of the tour, each between odometry of its time, as it comes in life."""
    bearings = -math.pi + math.tau / BEAMS * np.arange(BEAMS)
    walls, chance = furnished_flat(), np.random.default_rng(seed)
    driven = odometry(TRUTH, seed)
    for k in range(first, last):
        ranges = _ranges(walls, chance, TRUTH[k], MOUNT, bearings)
        stamp_s = begin_s + PERIOD_S * k
        yield moving(stamp_s - 0.02, driven[k])
        yield turn(stamp_s, "top", MOUNT, bearings, ranges)
        yield moving(stamp_s + 0.001, driven[k])
