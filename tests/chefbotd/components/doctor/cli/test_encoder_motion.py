"""What the doctor says of encoders comes from encoders."""

import math

import pytest

from chefbotd.components.doctor.cli.asked import _motion
from chefbotd.components.doctor.cli.collecting import Snapshot
from chefbotd.core.geometry import Pose2D
from chefbotd.settings import load
from tests.chefbotd.components.doctor.cli.bench import Answers, diagnosis_of


def test_a_mirrored_imu_does_not_turn_what_the_encoders_say() -> None:
    """The robot was turned left; odometry, which follows an IMU that is upside down, says right.

    ChefBot's wheels have a radius of 0.045 m and a track of 0.3 m: a quarter turn to the left rolls each wheel by
    0.3 / 2 * pi / 2 / 0.045 = 5.236 rad, the left one backward.
    """
    diagnosis = diagnosis_of(load(), Answers({}))
    before = Snapshot({"left_wheel": 1.0, "right_wheel": 2.0}, Pose2D(0.0, 0.0, 0.0))
    after = Snapshot({"left_wheel": 1.0 - 5.236, "right_wheel": 2.0 + 5.236}, Pose2D(0.0, 0.0, -math.pi / 2))
    motion = _motion(diagnosis, before, after)
    assert motion.heading_rad == pytest.approx(math.pi / 2, abs=1e-3)
    assert math.hypot(motion.x_m, motion.y_m) < 1e-6


def test_a_push_is_as_long_as_the_encoders_say() -> None:
    """Both wheels roll one turn: pi times 0.09 m."""
    diagnosis = diagnosis_of(load(), Answers({}))
    motion = _motion(
        diagnosis,
        Snapshot({"left_wheel": 0.0, "right_wheel": 0.0}),
        Snapshot({"left_wheel": math.tau, "right_wheel": math.tau}, Pose2D(5.0, 5.0, 1.0)),
    )
    assert motion.x_m == pytest.approx(math.pi * 0.09)
    assert motion.heading_rad == 0.0
