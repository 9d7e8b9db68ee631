"""Goals among people as users of other robots report them: somebody who follows, a goal that is renewed all the time."""

import numpy as np
import pytest

from benchmarks.situations import followed, renewed
from chefbotd.components.navigation.algorithms.evasion import MOST_FOR_GOAL_M
from chefbotd.components.navigation.algorithms.path import Goal
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.mapping.algorithms.slam.flat import box, wall
from tests.chefbotd.components.navigation.algorithms.drives import Drive, Person
from tests.chefbotd.components.navigation.algorithms.grids import rasterised

HALL = box(0, 0, 6.0, 4.0)
ALONE_S = 20.7
"""For 5 m of a hall with nobody about: 16.7 s at 0.3 m/s, the turns at both ends, and starting."""


def in_hall(*people: Person) -> Drive:
    """A robot in a hall of 6 by 4 m."""
    return Drive(rasterised(HALL, 6.0, 4.0), HALL, Pose2D(1.0, 2.0), list(people))


@pytest.mark.slow
@pytest.mark.parametrize(("behind_m", "most_s"), [(0.35, 1.5 * ALONE_S), (0.8, 1.2 * ALONE_S)])
def test_who_follows_the_robot_does_not_drive_it_off_its_way_or_past_its_goal(
    behind_m: float, most_s: float
) -> None:
    """At 0.3 m/s behind it: the way is at most a tenth longer, and at its goal it stops, turns and reports."""
    run = followed(1, behind_m)
    assert run.end is End.REACHED
    assert run.way_m < 5.5
    assert run.time_s < most_s
    assert run.least_m >= behind_m - 0.01


@pytest.mark.slow
def test_the_robot_says_for_whom_it_makes_way_and_does_so_a_limited_distance_for_a_goal() -> None:
    """Somebody walks to and fro over the robot's way and goal for a minute, and looks at nothing."""
    drive = in_hall(Person(np.array([[5.5, 2.0], [0.5, 2.0]]), 0.5, is_blind=True))
    drive.navigator.navigate_to((Goal(4.5, 2.0, 0.0),))
    drive.run(60.0)
    assert any(sentence.startswith("makes way for somebody at (") for sentence in drive.said)
    assert drive.way_m < 3.5 + MOST_FOR_GOAL_M + 1.5


def test_a_goal_that_is_renewed_ten_times_a_second_is_driven_to_like_one_goal() -> None:
    """8 s of a goal that shifts by a centimetre each time: within a tenth of the way for one goal that stays."""
    assert renewed(1, 10.0) == pytest.approx(renewed(1, 0.0), rel=0.1)


def test_a_goal_elsewhere_that_replaces_another_under_way_is_planned_without_standing() -> None:
    """The robot drives on at more than three quarters of its speed, and the goal before is told as replaced."""
    drive = in_hall()
    drive.navigator.navigate_to((Goal(5.0, 2.0, 0.0),))
    drive.run(4.0)
    drive.navigator.navigate_to((Goal(5.0, 3.0, 0.0),))
    before, slowest_m_s = drive.now_s, drive.twist.linear_m_s
    while drive.now_s < before + 2.0:
        drive.tick()
        slowest_m_s = min(slowest_m_s, drive.twist.linear_m_s)
    assert slowest_m_s > 0.75 * 0.3
    assert "a new goal replaced it" in drive.ended[0].reason
    drive.run(40.0)
    assert drive.ended[-1].end is End.REACHED


def test_a_renewed_goal_that_is_blocked_is_given_up_like_one_goal() -> None:
    """A wall that is on no map closes the way: trying to recover goes on from one to the next, until the end."""
    drive = in_hall()
    drive.walls = np.vstack([HALL, wall((2.5, 0.0), (2.5, 4.0))])
    states, actions = set[str](), set[str]()
    while drive.now_s < 40.0:
        drive.navigator.navigate_to((Goal(4.0, 2.0, 0.0),))
        for _ in range(5):
            drive.tick()
        states.add(str(drive.navigator.state))
        actions.add(drive.said[-1].rpartition(": ")[2])
    assert "recovering" in states
    assert len(actions) > 3
    assert drive.way_m < 4.0
