"""The pure steps about a goal: the queue, what is missing, whether the robot comes on, the way back."""

import math

import numpy as np
import pytest

from chefbotd.components.navigation.algorithms.costmap import costmap
from chefbotd.components.navigation.algorithms.driving import Missing, checked_inputs
from chefbotd.components.navigation.algorithms.interface import PoseStatus, StepInput
from chefbotd.components.navigation.algorithms.navigator import GoalQueue, add_goals, first_ended, keep_goals
from chefbotd.components.navigation.algorithms.path import Goal, Path
from chefbotd.components.navigation.algorithms.recovery import (
    InTheWay,
    LastProgress,
    Trail,
    checked_progress,
    extend_trail,
)
from chefbotd.components.navigation.algorithms.smooth import headings, resample_path
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.components.navigation.algorithms.steering import FollowState
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.components.navigation.algorithms.trips import Choice, Trip, choice
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import replace
from tests.chefbotd.components.mapping.algorithms.slam.flat import box
from tests.chefbotd.components.navigation.algorithms.drives import ROUND
from tests.chefbotd.components.navigation.algorithms.grids import rasterised

START = Pose2D(0.4, -0.2, 0.3)
A, B, C = Goal(1.0, 2.0), Goal(3.0, 1.0, 0.7), Goal(-1.0, 0.5)


def at(now_s: float, pose: Pose2D = START, status: PoseStatus = PoseStatus.LOCALIZED) -> StepInput:
    """A step 0.04 s after the last one."""
    return StepInput(now_s, 0.04, pose, status, Twist2D(0.2, 0.1))


def test_numbers_of_goals_go_on_after_a_cancellation() -> None:
    """Two goals are 1 and 2; cancelled, they both end, and the next one is 3."""
    queue, numbers = add_goals(GoalQueue(), (A, B))
    assert numbers == (1, 2)
    queue, ended = keep_goals(queue, (), "cancelled: as asked")
    assert [(each.goal, each.end) for each in ended] == [(1, End.CANCELLED), (2, End.CANCELLED)]
    queue, numbers = add_goals(queue, (C,))
    assert (numbers, queue.number) == ((3,), 3)


def test_only_a_goal_that_was_reached_leaves_the_next_one() -> None:
    """Reached, the second is next; blocked, it takes the third with it, which says why."""
    queue, _ = add_goals(GoalQueue(), (A, B, C))
    queue, ended = first_ended(queue, End.REACHED, "reached")
    assert ([each.goal for each in ended], queue.number) == ([1], 2)
    queue, ended = first_ended(queue, End.BLOCKED, "blocked for 30 s")
    assert queue.number is None
    assert [each.reason for each in ended] == [
        "blocked for 30 s",
        "cancelled: goal 2 before it ended blocked",
    ]


def test_a_lost_pose_ends_the_goal_after_twenty_seconds_by_the_clock() -> None:
    """Lost at 5 s: it stands at 24.9 s, and ends at 25 s; found in between, it goes on."""
    lost = checked_inputs(ROUND, Missing(), at(5.0, status=PoseStatus.LOST), 5.0).missing
    waiting = checked_inputs(ROUND, lost, at(24.9, status=PoseStatus.LOST), 24.9)
    assert waiting.stands == "waits, because its pose is not known"
    assert waiting.end is None
    assert checked_inputs(ROUND, lost, at(25.0, status=PoseStatus.LOST), 25.0).end is End.LOST
    found = checked_inputs(ROUND, lost, at(24.9, status=PoseStatus.UNCERTAIN), 24.8)
    assert (found.stands, found.is_over, found.missing) == ("", True, Missing())


def test_missing_scans_are_counted_by_steps_and_not_by_the_clock() -> None:
    """A minute that the computer slept through counts as the one step of 0.04 s that it was."""
    missing = checked_inputs(ROUND, Missing(), at(8.0), 7.3).missing
    after_sleep = checked_inputs(ROUND, missing, at(68.0), 7.3)
    assert after_sleep.stands == "waits, because no scan arrives"
    assert after_sleep.end is None
    assert after_sleep.missing.without_scan_s == pytest.approx(0.08)
    assert checked_inputs(ROUND, Missing(without_scan_s=9.97), at(68.0), 7.3).end is End.FAULT


def test_after_odometry_was_silent_the_robot_first_stands() -> None:
    """From 0.4 s of silence on, and for 0.2 s after it: it went on as before, and has to brake."""

    def stands(last: Missing, now_s: float, age_s: float) -> tuple[Missing, bool]:
        done = checked_inputs(ROUND, last, replace(at(now_s), pose_age_s=age_s), now_s)
        assert done.end is None
        return done.missing, bool(done.stands)

    last, is_standing = stands(Missing(), 7.0, 0.39)
    assert not is_standing
    for now_s, age_s, expected in (
        (7.1, 0.45, True),
        (7.6, 0.95, True),
        (7.79, 0.05, True),
        (7.81, 0.05, False),
    ):
        last, is_standing = stands(last, now_s, age_s)
        assert is_standing is expected, now_s


@pytest.mark.parametrize(("walks", "patience_s"), [(False, 1.5), (True, 6.0)])
def test_who_walks_is_waited_for_longer_than_a_thing(walks: bool, patience_s: float) -> None:
    """Blocked since 3 s: stuck after 1.5 s by a thing, and after 6 s by somebody who walks."""
    in_the_way, here = InTheWay(" at (1.20, 0.40)", walks), Pose2D(1.0, 0.3, 0.4)
    first = checked_progress(ROUND, LastProgress(2.9, here), at(3.0, here), in_the_way)
    assert first.waits == "waits, because something is in the way at (1.20, 0.40)"
    patient = checked_progress(ROUND, first.progress, at(2.9 + patience_s, here), in_the_way)
    assert (patient.waits, patient.stuck) == ("", "")
    stuck = checked_progress(ROUND, first.progress, at(3.0 + patience_s, here), in_the_way)
    assert stuck.stuck == "something is in the way at (1.20, 0.40)"
    free = checked_progress(ROUND, first.progress, at(3.4, here), None)
    assert (free.drives_again, free.progress.blocked_since_s) == (True, None)


def test_a_robot_that_only_shivers_does_not_come_on() -> None:
    """Within 0.04 m and 0.15 rad for over 6 s is stuck, also over the half circle; a turn by 0.16 rad is progress."""
    here = LastProgress(1.0, Pose2D(2.0, 1.0, 3.1))
    shivers = checked_progress(ROUND, here, at(7.1, Pose2D(2.03, 1.02, 3.2 - math.tau)), None)
    assert shivers.stuck == "the robot makes no progress"
    turned = Pose2D(2.0, 1.0, 3.1 + 0.16 - math.tau)
    assert checked_progress(ROUND, here, at(7.1, turned), None).progress == LastProgress(7.1, turned)


def test_a_robot_that_is_blocked_now_and_again_and_does_not_come_on_names_what_blocks_it() -> None:
    """No progress for over 6 s, and blocked for a moment only: the place is known all the same."""
    here = Pose2D(2.0, 1.0, 3.1)
    check = checked_progress(
        ROUND, LastProgress(1.0, here), at(7.1, here), InTheWay(" at (1.20, 0.40)", False)
    )
    assert check.stuck == "something is in the way at (1.20, 0.40)"


def test_the_trail_holds_the_last_two_metres_forward() -> None:
    """A point each 0.06 m: 41 of 60 are kept; backwards, and nearer than 0.05 m, adds none."""
    trail: Trail = ()
    for k in range(60):
        trail = extend_trail(trail, Pose2D(0.06 * k, 0.1), Twist2D(0.2, -0.1))
    assert len(trail) == 41
    assert trail[-1] == pytest.approx((3.54, 0.1))
    assert extend_trail(trail, Pose2D(3.0, 0.1), Twist2D(-0.1, 0.0)) is trail
    assert extend_trail(trail, Pose2D(3.58, 0.12), Twist2D(0.2, 0.0)) is trail


@pytest.mark.parametrize(
    ("new_y_m", "chosen"), [(0.45, Choice.TAKE_NEW), (0.24, Choice.KEEP)], ids=["clearer", "as near"]
)
def test_a_path_that_grazes_a_wall_gives_way_to_a_clearer_one_of_the_same_length(
    new_y_m: float, chosen: Choice
) -> None:
    """Planned round somebody, it has 4 cm beside it for 0.5 m of 28 m. 6 cm are no reason to take another; 25 cm are."""
    costs = costmap(ROUND.outline, rasterised(box(0, 0, 30.0, 4.0), 30.0, 4.0), 0.3)

    def path(y_m: float) -> Path:
        points = resample_path(np.array([(1.0, 0.5), (1.6, y_m), (2.1, y_m), (2.8, 1.0), (29.0, 1.2)]), 0.05)
        return Path(costs.frame, points, headings(points), Goal(29.0, 1.2))

    here, nothing = Pose2D(1.0, 0.5, -0.2), np.zeros((0, 2))
    near = Surroundings(nothing, nothing, np.zeros(0), costs.fixed_m, 0.05, here)
    left = Trip(path(0.22), FollowState())
    assert choice(ROUND, costs, left, Trip(path(new_y_m), FollowState()), at(1.0, here), near) is chosen
