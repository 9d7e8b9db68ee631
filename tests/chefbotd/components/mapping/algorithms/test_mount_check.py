"""A lidar that is turned in its mount: the way by the scans points elsewhere than the way by the wheels."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from chefbotd.components.mapping.algorithms.mount_check import MountCheck, check_scan
from chefbotd.core.poses import compose

START = np.array([3.0, -1.0, 0.7])
STEP_M = 0.03


def driven(
    seen: Callable[[int, np.ndarray], np.ndarray | None], scans: int = 12, turn_rad: float = 0.02
) -> tuple[MountCheck, int]:
    """Drive an arc, 3 cm a scan; ``seen`` makes of the true pose what localization finds. When it was told, too."""
    now, odometry, true = MountCheck(), np.array([0.4, 0.9, -1.1]), START
    for k in range(scans):
        now = check_scan(now, odometry, seen(k, true))
        if now.turned_rad is not None:
            return now, k
        motion = np.array([STEP_M, 0.0, turn_rad])
        odometry, true = compose(odometry, motion), compose(true, motion)
    return now, scans


def turned(by_rad: float) -> Callable[[int, np.ndarray], np.ndarray]:
    """A lidar in the robot's middle, turned CCW by so much: the heading that is found is more by as much."""
    return lambda k, true: true + np.array([0.0, 0.0, by_rad])


@pytest.mark.parametrize("by_deg", [180, 90, -90, 45, -150])
def test_it_is_found_within_a_quarter_of_a_metre(by_deg: float) -> None:
    """Three ways of 8 cm, which are 9 cm with 3 cm a scan: after 0.27 m, with the angle."""
    now, scans = driven(turned(math.radians(by_deg)))
    assert now.turned_rad is not None
    off = math.remainder(now.turned_rad - math.radians(by_deg), math.tau)
    assert abs(off) < 0.01
    assert scans * STEP_M == pytest.approx(0.27)


@pytest.mark.parametrize(
    "seen",
    [
        lambda k, true: true,
        lambda k, true: true + np.array([0.004 * (-1) ** k, 0.003, math.radians(20)]),
        lambda k, true: START,
        lambda k, true: START - 0.3 * (true - START),
        lambda k, true: None if k % 3 == 2 else true + np.array([0.0, 0.0, math.pi]),
    ],
    ids=["as configured", "by 20 degrees", "wheels that spin", "pushed back", "scans that do not fit"],
)
def test_what_is_no_turned_lidar_is_not_taken_for_one(seen: Callable[[int, np.ndarray], np.ndarray]) -> None:
    """Small angles, wheels that spin, a robot that is pushed while they do, and poses that come and go."""
    assert driven(seen, scans=60)[0].turned_rad is None


def test_turning_in_place_says_nothing() -> None:
    """A lidar beside the robot's middle moves with the heading."""
    now = MountCheck()
    for k in range(40):
        heading = 0.2 * k
        odometry = np.array([0.03 * math.cos(heading), 0.03 * math.sin(heading), heading])
        found = np.array([-0.1 * math.cos(heading), -0.1 * math.sin(heading), heading + math.pi])
        now = check_scan(now, odometry, found)
    assert now.turned_rad is None


def test_ways_that_do_not_say_the_same_are_not_believed() -> None:
    """Somebody pushes to the left, then to the right."""
    sides = [math.pi / 2, -math.pi / 2]
    now, odometry, true = MountCheck(), np.zeros(3), START
    for k in range(60):
        now = check_scan(now, odometry, true)
        side = sides[k // 5 % 2]
        odometry = odometry + np.array([STEP_M, 0.0, 0.0])
        true = true + STEP_M * np.array([math.cos(0.7 + side), math.sin(0.7 + side), 0.0])
    assert now.turned_rad is None
