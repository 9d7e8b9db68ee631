"""The benchmark of the estimator: its light simulation does what it says."""

import math
import random
from itertools import islice
from pathlib import Path

import pytest

from benchmarks import estimation, slipping


def test_a_slipping_wheel_rolls_and_does_not_move_the_robot() -> None:
    """A wheel that loses all: the counted turn differs from the true one by its travel over the track."""
    chance = random.Random(1)
    robot = slipping.Robot(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    before_rad, lost = 0.0, []
    for moment in islice(slipping.drive(robot, 30.0, chance, raw_imu=False, slips=(1.0, 1.0)), 600):
        by_wheels_rad = (moment.right_m - moment.left_m) / slipping.TRACK_M
        off_rad = moment.heading_rad - before_rad - by_wheels_rad
        before_rad = moment.heading_rad
        if moment.slipping_s is not None:
            rolled = [moment.left_m, -moment.right_m]
            lost.append(min(abs(off_rad - way_m / slipping.TRACK_M) for way_m in rolled))
    assert len(lost) > 20
    assert max(lost) < 0.01  # random slip and a count


def test_a_perfect_robot_is_where_its_wheels_say() -> None:
    """Nothing off, 10 s: within the random slip, which is a millimetre."""
    chance = random.Random(2)
    odometry = slipping.fused(slipping.CALIBRATED)
    for moment in slipping.drive(slipping.Robot(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 10.0, chance, raw_imu=True):
        slipping.feed(odometry, moment)
    estimate = odometry.estimate
    assert math.hypot(estimate.x_m - moment.x_m, estimate.y_m - moment.y_m) < 0.02
    assert estimate.heading_rad == pytest.approx(moment.heading_rad, abs=0.02)


def test_without_the_recording_it_says_so(tmp_path: Path) -> None:
    """It is skipped, and no figure is made up."""
    figures, remarks = estimation._recorded(tmp_path, 1, None)
    assert figures == []
    assert "skipped" in remarks[0]
