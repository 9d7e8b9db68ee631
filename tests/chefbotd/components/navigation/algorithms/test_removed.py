"""A thing of the map that was taken away is no wall for ever; what may be glass, or is there, stays one."""

import math

import numpy as np
import pytest

from chefbotd.components.navigation.algorithms.interface import PoseStatus
from chefbotd.components.navigation.algorithms.path import Goal
from chefbotd.components.navigation.algorithms.removed import find_things
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.components.zones.zone_file import parse_zones
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OCCUPIED, UNKNOWN
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, box, wall
from tests.chefbotd.components.navigation.algorithms.drives import Person
from tests.chefbotd.components.navigation.algorithms.grids import drawn, rasterised
from tests.chefbotd.components.navigation.algorithms.guarded import Guarded

HALL = box(0, 0, 9.0, 4.0)
CUPBOARD = box(6.0, 1.7, 0.6, 0.6)
GOES_TO_LOOK = "the map has something at (6.30, 2.00): going to look whether it is still there"


AT_CUPBOARD = Goal(6.3, 2.0, 0.0)


def sent(drive: Guarded, goal: Goal = AT_CUPBOARD, within_s: float = 90.0) -> Guarded:
    """Drive to a goal."""
    drive.navigator.navigate_to((goal,))
    drive.run(within_s)
    return drive


def mapped(*things: Floats) -> Guarded:
    """A robot at the hall's west end, whose map has things that are not there."""
    return Guarded(rasterised(np.vstack([HALL, *things]), 9.0, 4.0), HALL, Pose2D(1.5, 2.0), has_sonar=False)


def test_a_goal_where_a_thing_was_taken_away_is_reached_after_a_look() -> None:
    """A cupboard in the hall's middle, 4 m away; it says what it goes to look at."""
    drive = sent(mapped(CUPBOARD))
    assert GOES_TO_LOOK in drive.said
    assert drive.ended[-1].end is End.REACHED
    assert math.dist((drive.pose.x_m, drive.pose.y_m), (6.3, 2.0)) < 0.04


def test_a_way_that_only_a_thing_of_the_map_closes_is_driven_after_a_look() -> None:
    """It stands in the only door, with 5 cm beside it on both sides."""
    walls = np.vstack([HALL, wall((4.5, 0.0), (4.5, 1.5)), wall((4.5, 2.5), (4.5, 4.0))])
    grid = rasterised(np.vstack([walls, box(4.4, 1.6, 0.8, 0.8)]), 9.0, 4.0)
    drive = sent(Guarded(grid, walls, Pose2D(1.5, 2.0), has_sonar=False), Goal(7.5, 2.0))
    assert any("going to look" in said for said in drive.said)
    assert drive.ended[-1].end is End.REACHED


def test_a_thing_that_is_still_there_is_seen_and_said() -> None:
    """From behind a screen, from where the lidar cannot see it; nothing is touched, and the goal is unreachable."""
    walls = np.vstack([HALL, CUPBOARD, wall((4.5, 0.0), (4.5, 2.9))])
    drive = Guarded(rasterised(walls, 9.0, 4.0), walls, Pose2D(1.5, 1.0), has_sonar=False)
    sent(drive)
    assert GOES_TO_LOOK in drive.said
    assert drive.ended[-1].end is End.UNREACHABLE
    assert "it went to look: something still stands at (6.30, 2.00)" in drive.ended[-1].reason
    assert drive.least_m > 0.02
    assert drive.now_s < 60.0


def test_what_the_lidar_sees_to_be_there_is_refused_within_a_second_and_a_few_centimetres() -> None:
    """Nobody has to drive there: it is in sight, 2 m away."""
    walls = np.vstack([HALL, CUPBOARD])
    drive = sent(Guarded(rasterised(walls, 9.0, 4.0), walls, Pose2D(4.0, 2.0), has_sonar=False))
    assert drive.ended[-1].end is End.UNREACHABLE
    assert drive.now_s < 1.0
    assert drive.way_m < 0.05


def test_a_pane_between_walls_that_a_lidar_sees_through_stays_a_wall() -> None:
    """The map has a glass door, the lidar sees the room behind it: the robot does not even go to look."""
    walls = np.vstack([HALL, wall((4.5, 0.0), (4.5, 1.5)), wall((4.5, 2.5), (4.5, 4.0))])
    grid = rasterised(np.vstack([walls, wall((4.5, 1.5), (4.5, 2.5))]), 9.0, 4.0)
    drive = sent(Guarded(grid, walls, Pose2D(3.0, 2.0), has_sonar=False), Goal(7.5, 2.0), 30.0)
    assert drive.ended[-1].end is End.UNREACHABLE
    assert drive.way_m < 0.05


def test_a_pane_that_stands_free_stays_a_wall() -> None:
    """1 m long, and thin: it may be glass. The goal is in it."""
    drive = sent(mapped(wall((6.3, 1.5), (6.3, 2.5))), within_s=30.0)
    assert drive.ended[-1].end is End.UNREACHABLE
    assert drive.way_m < 0.05


def test_what_a_range_sensor_hears_where_the_lidar_sees_nothing_stays_a_wall() -> None:
    """A show-case of glass: an echo comes from its side, 0.2 m before its middle, while the robot drives to it."""
    drive = mapped(CUPBOARD)
    drive.navigator.navigate_to((Goal(6.3, 2.0),))
    while drive.now_s < 90.0 and not drive.ended:
        drive.tick()
        away_m = 6.0 - drive.pose.x_m
        if 0.3 < away_m < 1.5 and abs(drive.pose.y_m - 2.0) < 0.6:
            towards = Pose2D(0.0, 0.0, math.atan2(2.0 - drive.pose.y_m, 6.0 - drive.pose.x_m))
            mount = Pose2D(0.0, 0.0, towards.heading_rad - drive.pose.heading_rad)
            range_m = math.dist((6.0, 2.0), (drive.pose.x_m, drive.pose.y_m))
            drive.navigator.take_range(drive.now_s, drive.pose, mount, range_m, 0.2)
    assert drive.ended[-1].end is End.UNREACHABLE
    assert max(passed.x_m for passed in drive.passed) < 6.0 or all(
        abs(passed.y_m - 2.0) > 0.4 for passed in drive.passed if passed.x_m >= 6.0
    )


def test_a_virtual_wall_stays_where_a_thing_was_taken_away() -> None:
    """A keep-out zone over the cupboard: the robot may look, but the goal in it is refused."""
    drive = mapped(CUPBOARD)
    zone = "keep_out:\n  - {name: cupboard, corners_m: [[5.9, 1.6], [6.7, 1.6], [6.7, 2.4], [5.9, 2.4]]}\n"
    drive.navigator.use_map(drive.grid, parse_zones(zone, "zones"))
    sent(drive, within_s=60.0)
    assert drive.ended[-1].end is End.UNREACHABLE
    assert all(math.dist((passed.x_m, passed.y_m), (6.3, 2.0)) > 0.5 for passed in drive.passed)


def test_a_pose_that_is_uncertain_takes_nothing_off_the_map() -> None:
    """Beams of a wrong pose go through things that are there."""
    drive = mapped(CUPBOARD)
    drive.status = PoseStatus.UNCERTAIN
    sent(drive, Goal(4.5, 2.0), 60.0)
    assert drive.ended[-1].end is End.REACHED
    assert drive.navigator.world is not None
    assert not drive.navigator.world.things.passes.any()


def test_a_thing_of_which_a_leg_is_left_stays_a_wall() -> None:
    """Of a table's four legs and its frame on the map, one leg of 4 cm stands there still."""
    walls = np.vstack([HALL, box(6.0, 1.7, 0.04, 0.04)])
    grid = rasterised(np.vstack([walls, CUPBOARD]), 9.0, 4.0)
    drive = sent(Guarded(grid, walls, Pose2D(1.5, 2.0), has_sonar=False))
    assert drive.ended[-1].end is End.UNREACHABLE
    assert drive.least_m > 0.02


def test_somebody_who_stands_where_a_thing_was_is_not_touched() -> None:
    """He came after the cupboard went: the robot sees him, and does not get there."""
    drive = mapped(CUPBOARD)
    drive.people = [Person(np.array([[6.3, 2.0], [6.3, 2.01]]), speed_m_s=0.0)]
    sent(drive)
    assert drive.ended[-1].end is not End.REACHED
    assert drive.least_m > 0.02


def test_unknown_space_inside_a_thing_that_was_taken_away_is_driven_through() -> None:
    """A map that a lidar made knows only the sides of a cupboard."""
    drive = mapped(CUPBOARD)
    inside = drive.grid.percent[35:46, 121:132]
    inside[inside != OCCUPIED] = UNKNOWN
    drive.navigator.use_map(drive.grid)
    sent(drive)
    assert drive.ended[-1].end is End.REACHED


def test_only_small_things_that_stand_free_can_be_gone() -> None:
    """A block of 3 by 3 cells, and a post; neither the wall, nor what joins it, nor a thin pane."""
    grid = drawn(
        "####################",
        "#..................#",
        "#..###.............#",
        "#..###......#......#",
        "#..###......#....###",
        "#...........#....###",
        "#...#.......#......#",
        "#..................#",
        "####################",
        resolution_m=0.1,
    )
    drive = Guarded(grid, HALL, Pose2D(0.5, 0.2))
    assert drive.navigator.world is not None
    things = find_things(drive.navigator.world.ground.walls, drive.navigator.world.frame)
    assert len(things.centers_m) == 2
    assert sorted(np.bincount(things.thing).tolist()) == [1, 9]
    block = int(np.argmax(np.bincount(things.thing)))
    assert things.centers_m[block].tolist() == pytest.approx([0.45, 0.55])
