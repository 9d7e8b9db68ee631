"""Goals beside walls, with the obstacle guards at work: the robot gets there, or the end names the obstacle."""

import math
import re

import numpy as np
import pytest

from chefbotd.components.navigation.algorithms.interface import NavigationParameters
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.path import Goal, NoPath
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.core.geometry import Pose2D
from chefbotd.safety.outline import Box
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, box, furnished_flat, wall
from tests.chefbotd.components.navigation.algorithms.drives import RADIUS_M
from tests.chefbotd.components.navigation.algorithms.grids import rasterised
from tests.chefbotd.components.navigation.algorithms.guarded import Guarded, off

SMALL, FLAT = box(0, 0, 4.0, 3.0), furnished_flat()
NORTH = math.pi / 2
KHAN = Footprint(corners_m=((0.16, 0.075), (-0.16, 0.075), (-0.16, -0.075), (0.16, -0.075)))


def driven(
    walls: Floats, size_m: tuple[float, float], start: Pose2D, goal: Goal, **options: object
) -> Guarded:
    """A robot that was sent there, after the end of its goal."""
    drive = Guarded(rasterised(walls, *size_m), walls, start, **options)
    drive.navigator.navigate_to((goal,))
    drive.run(120.0)
    return drive


@pytest.mark.slow
@pytest.mark.parametrize("apart_m", [0.10, 0.12, 0.15])
@pytest.mark.parametrize("turn_rad", [0.0, 1.0, -1.1, NORTH])
@pytest.mark.parametrize("room", ["small", "flat"])
def test_a_goal_beside_a_wall_is_reached_with_any_heading(room: str, apart_m: float, turn_rad: float) -> None:
    """The way there leads straight at the wall, and the ultrasonic sensor reads 2.5 cm too little: it stops early."""
    if room == "small":
        walls, size_m, start = SMALL, (4.0, 3.0), Pose2D(2.0, 1.2, NORTH)
        goal = Goal(2.0, 3.0 - RADIUS_M - apart_m, NORTH + turn_rad)
    else:
        walls, size_m, start = FLAT, (10.4, 8.1), Pose2D(2.0, 2.4, math.pi)
        goal = Goal(RADIUS_M + apart_m, 2.4, math.pi + turn_rad)
    drive = driven(walls, size_m, start, goal, short_m=0.025)
    assert [each.end for each in drive.ended] == [End.REACHED], drive.ended
    off_m, off_deg = off(drive, goal.x_m, goal.y_m, goal.heading_rad or 0.0)
    assert off_m < 0.03
    assert off_deg < 3.0
    assert drive.least_m > 0.06


@pytest.mark.parametrize("apart_m", [0.01, 0.025, 0.03])
@pytest.mark.parametrize("heading_rad", [0.0, NORTH, -NORTH])
def test_a_goal_that_the_guards_keep_it_from_is_refused_before_it_drives(
    apart_m: float, heading_rad: float
) -> None:
    """Before the wall at y = 3 the guards stop it 7 cm from it; a pose with so much room is offered."""
    drive = Guarded(rasterised(SMALL, 4.0, 3.0), SMALL, Pose2D(2.0, 1.2, NORTH))
    goal = Goal(2.0, 3.0 - RADIUS_M - apart_m, heading_rad)
    refused = drive.navigator.plan_path(drive.pose, goal, 0.0)
    assert isinstance(refused, NoPath)
    assert not refused.only_for_now
    assert refused.nearest is not None
    assert 0.06 < 3.0 - RADIUS_M - refused.nearest.y_m < 0.2
    assert abs(refused.nearest.x_m - 2.0) < 0.06
    assert (
        drive.navigator.plan_path(drive.pose, Goal(2.0, refused.nearest.y_m, heading_rad), 0.0).length_m > 1.0
    )


@pytest.mark.slow
def test_a_goal_that_the_guards_keep_it_from_after_all_ends_in_seconds_and_names_the_wall_of_the_map() -> (
    None
):
    """The true wall stands 6 cm before the one on the map: nobody is asked to clear it out of the way."""
    walls = box(0, 0, 4.0, 2.94)
    drive = Guarded(rasterised(SMALL, 4.0, 3.0), walls, Pose2D(2.0, 1.2, NORTH))
    drive.navigator.navigate_to((Goal(2.0, 3.0 - RADIUS_M - 0.08, 0.0),))
    drive.run(120.0)
    (ended,) = drive.ended
    assert ended.end is End.BLOCKED
    assert "the wall of the map at (" in ended.reason
    assert drive.now_s < 40.0
    assert not [sentence for sentence in drive.said if "asks" in sentence or "clear the way" in sentence]


def oblong(walls: Floats, start: Pose2D, goal: Goal) -> Guarded:
    """KHAN's outline, with a lidar alone."""
    params = NavigationParameters(outline=KHAN)
    return driven(walls, (4.0, 3.0), start, goal, params=params, shape=Box(0.16, 0.075), has_sonar=False)


def test_a_heading_that_does_not_fit_is_refused_with_the_obstacle() -> None:
    """0.12 m from the wall at x = 4: along the wall there are 4.5 cm beside the outline, and its nose is 16 cm long."""
    drive = Guarded(
        rasterised(SMALL, 4.0, 3.0), SMALL, Pose2D(2.0, 1.5), params=NavigationParameters(outline=KHAN)
    )
    refused = drive.navigator.plan_path(drive.pose, Goal(3.88, 1.5, 0.0), 0.0)
    assert isinstance(refused, NoPath)
    at = re.search(
        r"with which the robot would touch the obstacle at \((.*), (.*)\); the nearest", refused.reason
    )
    assert at, refused.reason
    assert float(at[1]) == pytest.approx(4.0, abs=0.06)
    assert float(at[2]) == pytest.approx(1.5, abs=0.09)


ALLEY = np.vstack([SMALL, wall((2.8, 1.32), (4.0, 1.32)), wall((2.8, 1.68), (4.0, 1.68))])


@pytest.mark.slow
def test_an_outline_with_corners_does_not_turn_where_one_would_hit_and_the_end_names_it() -> None:
    """An alley of 0.36 m: 0.32 m long it fits across, its diagonal of 0.353 m with 1.5 cm to spare does not."""
    drive = oblong(ALLEY, Pose2D(2.2, 1.5), Goal(3.4, 1.5, NORTH))
    (ended,) = drive.ended
    assert ended.end is End.BLOCKED
    assert drive.least_m > 0.0
    at = re.search(r"something.* at \((.*), (.*)\)", ended.reason)
    assert at, ended.reason
    assert abs(float(at[2]) - 1.5) == pytest.approx(0.18, abs=0.04)
    assert float(at[1]) == pytest.approx(3.4, abs=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("apart_m", [0.11, 0.15])
@pytest.mark.parametrize("turn_rad", [0.0, 1.0])
def test_an_outline_with_corners_turns_beside_a_wall_where_it_has_room(
    apart_m: float, turn_rad: float
) -> None:
    """From its corners at 0.177 m to the wall: 11 cm and more, and the guard keeps 7."""
    goal = Goal(2.0, 3.0 - 0.177 - apart_m, NORTH + turn_rad)
    drive = oblong(SMALL, Pose2D(2.0, 1.2, NORTH), goal)
    assert [each.end for each in drive.ended] == [End.REACHED], drive.ended
    assert drive.least_m > 0.05
