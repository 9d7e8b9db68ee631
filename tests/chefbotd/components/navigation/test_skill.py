"""Where the skill takes the robot to be while odometry is silent."""

import math

import pytest

from chefbotd.components.navigation.skill import expect_odometry
from chefbotd.core.events.robot import OdometryUpdated
from chefbotd.core.geometry import CERTAIN, Pose2D, Twist2D


def test_a_robot_whose_board_is_silent_is_expected_to_move_on_as_it_did() -> None:
    """A quarter circle of 0.4 m radius to the right, from (1, 2) at 0.5 rad, takes 2 s: half of it is 1 s."""
    turning_rad_s = -math.pi / 4
    odometry = OdometryUpdated(
        3.0, 3.0, Pose2D(1.0, 2.0, 0.5), Twist2D(0.1 * math.pi, turning_rad_s), CERTAIN
    )
    x_m, y_m, heading_rad = expect_odometry(odometry, 4.0)
    forward_m, left_m = 0.4 * math.sin(math.pi / 4), -0.4 * (1 - math.cos(math.pi / 4))
    assert x_m == pytest.approx(1.0 + forward_m * math.cos(0.5) - left_m * math.sin(0.5), abs=0.01)
    assert y_m == pytest.approx(2.0 + forward_m * math.sin(0.5) + left_m * math.cos(0.5), abs=0.01)
    assert heading_rad == pytest.approx(0.5 + turning_rad_s)


def test_what_is_older_than_the_reading_is_where_it_says() -> None:
    """A time before the reading moves nothing back, and after 1.5 s of silence it is moved on no farther."""
    odometry = OdometryUpdated(3.0, 3.0, Pose2D(1.0, 2.0), Twist2D(0.3), CERTAIN)
    assert expect_odometry(odometry, 2.9).tolist() == pytest.approx([1.0, 2.0, 0.0])
    assert expect_odometry(odometry, 9.0).tolist() == pytest.approx([1.45, 2.0, 0.0])
