"""A pose that jumps: what was seen from the wrong one is forgotten, and the way is planned again."""

import math

import numpy as np

from chefbotd.components.navigation.algorithms.interface import Seen
from chefbotd.components.navigation.algorithms.path import Goal
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.components.zones.zone_file import NO_ZONES
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.mapping.algorithms.slam.flat import box
from tests.chefbotd.components.navigation.algorithms.drives import ROUND, Drive
from tests.chefbotd.components.navigation.algorithms.grids import rasterised

HALL = box(0, 0, 8.0, 4.0)
RIGHT, WRONG = Pose2D(6.0, 2.0, 0.0), Pose2D(2.0, 2.0, 0.0)
BEARINGS = np.linspace(-math.pi, math.pi, 360, endpoint=False)
WALL = np.stack([np.full(60, 1.9), np.linspace(-1.9, 1.9, 60)], axis=1)
"""The end wall, as the robot sees it from the right pose."""


def world() -> WorldModel:
    """A hall of 8 by 4 m, whose end wall was seen for a second from a pose 4 m off."""
    model = WorldModel(ROUND, rasterised(HALL, 8.0, 4.0), NO_ZONES)
    for k in range(10):
        assert not model.add_scan(Seen(1.0 + 0.1 * k, WRONG, np.zeros(2), WALL))
    assert len(model.obstacles(2.0)) > 20
    return model


def test_walls_seen_from_a_wrong_pose_are_forgotten_when_the_right_one_is_told() -> None:
    """A wall across the hall, 4 m before the real one."""
    model = world()
    assert model.add_scan(Seen(2.0, RIGHT, np.zeros(2), WALL))
    assert not len(model.obstacles(2.0))


def test_a_turn_of_the_pose_is_a_jump_too_and_a_small_correction_is_none() -> None:
    """40 degrees at once; 8 cm are what localization corrects all the time."""
    model = world()
    small = Pose2D(WRONG.x_m + 0.08, WRONG.y_m, 0.02)
    assert not model.add_scan(Seen(2.0, small, np.zeros(2), WALL))
    assert model.add_scan(Seen(2.1, Pose2D(small.x_m, small.y_m, 0.7), np.zeros(2), WALL))


def test_what_a_depth_camera_saw_beside_the_robot_goes_with_it() -> None:
    """A shoe 0.5 m to the left, which the lidar looks over; one 2 m away is forgotten."""
    model = world()
    shoes = np.array([[0.0, 0.5], [0.02, 0.5], [2.0, 0.0], [2.02, 0.0]])
    for k in range(5):
        model.take_low_scan(Seen(1.5 + 0.1 * k, WRONG, np.zeros(2), shoes))
    model.add_scan(Seen(2.0, RIGHT, np.zeros(2), WALL))
    points = model.obstacles(2.0)
    assert len(points)
    assert np.hypot(points[:, 0] - 6.0, points[:, 1] - 2.5).max() < 0.1


def test_a_robot_that_is_told_its_right_pose_is_not_blocked_by_what_it_saw_from_the_wrong_one() -> None:
    """It stands before the end wall and believes to be 4 m before it; then it drives where it saw that wall."""
    drive = Drive(rasterised(HALL, 8.0, 4.0), HALL, RIGHT)
    true = drive._measured
    drive._measured = lambda: Pose2D(true().x_m - 4.0, true().y_m, true().heading_rad)  # type: ignore[method-assign]
    while drive.now_s < 3.0:
        drive.tick()
    drive._measured = true  # type: ignore[method-assign]
    drive.navigator.navigate_to((Goal(1.5, 2.0, math.pi),))
    drive.run(40.0)
    assert drive.ended[-1].end is End.REACHED
    assert drive.now_s < 3.0 + 25.0
    assert not [sentence for sentence in drive.said if "in the way" in sentence or "no way" in sentence]
