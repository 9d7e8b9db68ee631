"""A robot that is carried where the scans fit nearly as well: it does not stay sure of a wrong place."""

import math

import numpy as np
import pytest

from chefbotd.components.localization.algorithms.localizer import LocalizationReport
from chefbotd.components.localization.algorithms.searching import LocalizationMap, localization_map
from chefbotd.components.localization.algorithms.state import PoseState, set_pose
from chefbotd.components.localization.algorithms.tracking import PoseEstimate
from chefbotd.core.poses import between
from chefbotd.core.record import replace
from tests.chefbotd.components.localization.algorithms.buildings import (
    Robot,
    corridor_of_mirrored_rooms,
    drawn,
    off,
    three_equal_rooms,
)
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, Lidar

STILL = np.zeros(3)


@pytest.fixture(scope="module")
def corridor() -> LocalizationMap:
    """The map of a corridor between two rooms."""
    return localization_map(drawn(corridor_of_mirrored_rooms()))


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ((12.09, 0.98, 2.94), (4.43, 1.28, 0.24)),  # a search nearby finds a place that fits by 0.94
        ((12.55, 1.42, 0.25), (2.3, 0.51, 3.01)),  # turned round, in the other room's mirror image
        ((7.22, 1.12, 1.36), (4.72, 1.12, 1.36)),  # 2.5 m along the corridor
    ],
)
def test_a_robot_that_was_carried_to_a_place_nearly_alike_is_not_sure_of_it(
    corridor: LocalizationMap, before: tuple[float, float, float], after: tuple[float, float, float]
) -> None:
    """The wheels stood still, and the scans fit by 0.8 and more: localized at a wrong place for less than a second."""
    robot, lidar, truth = Robot(corridor), Lidar(corridor_of_mirrored_rooms(), 9), np.array(after)
    robot.now = set_pose(robot.now, np.array(before))
    report = robot.look(STILL, lambda: lidar.points(np.array(before)), 30)
    assert report.state is PoseState.LOCALIZED
    robot.reports.clear()
    robot.look(STILL, lambda: lidar.points(truth), 60)
    assert sum(_is_wrong(report, truth) for report in robot.reports) < 10


def test_a_robot_that_sees_nothing_of_the_map_is_uncertain_after_ten_seconds(
    corridor: LocalizationMap,
) -> None:
    """Odometry carries it beyond the map: sure for 10 s, uncertain for as long again, and then it is given up."""
    robot, lidar = Robot(corridor, auto_search=False), Lidar(corridor_of_mirrored_rooms(), 9)
    robot.now = set_pose(robot.now, np.array([100.0, 100.0, 0.3]))
    robot.now = replace(robot.now, state=PoseState.LOCALIZED, is_unchecked=False)
    robot.now = replace(robot.now, estimate=replace(_estimate(robot), covariance=1e-4 * np.eye(3)))
    robot.look(STILL, lambda: lidar.points(np.array([7.0, 0.9, 0.3])), 205)
    states = [report.state for report in robot.reports]
    assert states.count(PoseState.LOCALIZED) == pytest.approx(100, abs=2)
    assert states.count(PoseState.UNCERTAIN) == pytest.approx(100, abs=2)
    assert states[-1] is PoseState.LOST


def out_of_room(x_m: float) -> Floats:
    """Poses (n, 3), 12 mm apart: from the middle of the room at x through its door, and 4 m to the right."""
    up = [(x_m + 1.45, y, math.pi / 2) for y in np.arange(1.5, 3.75, 0.012)]
    turned = [(x_m + 1.45, 3.75, angle) for angle in np.linspace(math.pi / 2, 0.0, 25)]
    return np.array(up + turned + [(x, 3.75, 0.0) for x in np.arange(x_m + 1.45, x_m + 5.45, 0.012)])


def test_a_robot_that_was_carried_to_the_next_equal_room_finds_the_right_one_within_five_seconds_of_doubt() -> (
    None
):
    """It is sure of the wrong room as long as all looks the same. In the corridor it is uncertain, and searches."""
    walls, lidar = three_equal_rooms(), Lidar(three_equal_rooms(), 1)
    robot, way = Robot(localization_map(drawn(walls))), out_of_room(3.0)
    believed = way[0] - [3.0, 0.0, 0.0]
    robot.now = set_pose(robot.now, believed)
    assert robot.look(STILL, lambda: lidar.points(believed), 60).state is PoseState.LOCALIZED
    robot.reports.clear()
    for truth in way:
        report = robot.take(between(way[0], truth), lidar.points(truth))
    states = [each.state for each in robot.reports]
    assert states[0] is PoseState.LOCALIZED
    assert states.count(PoseState.UNCERTAIN) < 40
    assert not _is_wrong(report, way[-1])
    assert report.state is PoseState.LOCALIZED


def _estimate(robot: Robot) -> PoseEstimate:
    assert robot.now.estimate is not None
    return robot.now.estimate


def _is_wrong(report: LocalizationReport, truth: Floats) -> bool:
    off_m, off_deg = off(report, truth)
    return report.state is PoseState.LOCALIZED and (off_m > 0.3 or off_deg > 20.0)
