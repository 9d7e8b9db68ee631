"""Goals in small buildings, with people and chairs that are on no map: reached, or ended with the true reason."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from chefbotd.components.navigation.algorithms.interface import Ended, NavigationParameters, PoseStatus
from chefbotd.components.navigation.algorithms.navigator import Navigator, NoMapError
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.path import Goal, NoPath, Path
from chefbotd.components.navigation.algorithms.states import End, GoalState
from chefbotd.core.geometry import Pose2D, wrap_angle
from tests.budget import sample
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, box, furnished_flat, wall
from tests.chefbotd.components.navigation.algorithms.buildings import office
from tests.chefbotd.components.navigation.algorithms.drives import ROUND, Drive, Person
from tests.chefbotd.components.navigation.algorithms.grids import rasterised


@dataclass
class Standing(Person):
    """Walks to the end of his way, stands there until he leaves, and walks back."""

    leaves_s: float = 0.0
    now_s: float = 0.0

    def walk(self, dt_s: float, robot: Pose2D) -> None:
        """One step; he looks at nothing."""
        self.now_s += dt_s
        step_m = self.speed_m_s * dt_s * (1 if self.now_s < self.leaves_s else -1)
        self.along_m = min(max(self.along_m + step_m, 0.0), math.dist(*self.way))


FLAT = rasterised(furnished_flat(), 10.4, 8.1)
KITCHEN, ROOM = Pose2D(2.0, 2.4, 2.0), Goal(9.25, 5.6, 1.0)
HALL = box(0, 0, 7.0, 3.0)


def hall(*more: Floats, known: tuple[Floats, ...] = (), **options: object) -> Drive:
    """A hall of 7 by 3 m, with things in it that are on the map (``known``) and others that are not."""
    on_map = np.vstack([HALL, *known])
    drive = {"pose": Pose2D(0.8, 1.4, 0.3), **options}
    return Drive(rasterised(on_map, 7.0, 3.0), np.vstack([on_map, *more]), **drive)


def sent(drive: Drive, *goals: Goal, within_s: float = 90.0) -> Ended:
    """Send it, and wait for the end of all goals."""
    drive.navigator.navigate_to(goals)
    drive.run(within_s)
    assert drive.ended, f"no end after {within_s} s: {drive.said}"
    return drive.ended[-1]


def off(drive: Drive, goal: Goal) -> tuple[float, float]:
    """How far the robot really is from the goal: metres, degrees."""
    turned = wrap_angle(drive.pose.heading_rad - (goal.heading_rad or 0.0))
    return math.hypot(drive.pose.x_m - goal.x_m, drive.pose.y_m - goal.y_m), abs(math.degrees(turned))


@pytest.mark.slow
def test_through_two_doors_into_another_room() -> None:
    """Reached within 0.03 m and 3 degrees, 0.1 m from everything, in the time that was foretold to a third."""
    drive = Drive(FLAT, furnished_flat(), KITCHEN)
    path = drive.navigator.plan_path(KITCHEN, ROOM, 0.0)
    assert isinstance(path, Path)
    foretold_s = drive.navigator.time_s(path, KITCHEN)
    assert sent(drive, ROOM).end is End.REACHED
    distance_m, degrees = off(drive, ROOM)
    assert distance_m < 0.03
    assert degrees < 3.0
    assert drive.least_m > 0.10
    assert drive.now_s == pytest.approx(foretold_s, rel=0.33)
    assert drive.way_m == pytest.approx(path.length_m, rel=0.05)


@pytest.mark.slow
def test_an_oblong_robot_drives_and_turns_without_touching() -> None:
    """KHAN's outline, 0.32 by 0.15 m with the origin in its middle, from desk to desk."""
    building = office(1)
    outline = Footprint(corners_m=((0.16, 0.075), (-0.16, 0.075), (-0.16, -0.075), (0.16, -0.075)))
    drive = Drive(
        rasterised(building.walls, 12, 9), building.walls, Pose2D(0.5, 3.2, 1.0),
        params=NavigationParameters(outline=outline),
    )  # fmt: skip
    goal = Goal(7.2, 1.0, -2.2)
    assert sent(drive, goal).end is End.REACHED
    assert drive.least_m > 0.0
    assert off(drive, goal)[0] < 0.03


@pytest.mark.slow
def test_a_chair_that_is_not_on_the_map_is_driven_round() -> None:
    """It stands in the middle of the way; 5 cm and more stay free of it, and there is no need to recover."""
    drive = hall(box(3.1, 1.2, 0.45, 0.45, 0.3))
    goal = Goal(6.2, 1.6, 0.4)
    assert sent(drive, goal).end is End.REACHED
    assert drive.least_m > 0.05
    assert not any("backs out" in said for said in drive.said)


@pytest.mark.slow
def test_a_door_10_cm_wider_than_the_robot_is_driven_through() -> None:
    """0.46 m, at odds with the grid, seen by a lidar with noise."""
    door = np.vstack([wall((3.513, 0), (3.513, 1.237)), wall((3.513, 1.697), (3.513, 3.0))])
    drive = hall(known=(door,))
    assert sent(drive, Goal(6.0, 1.0, 0.0)).end is End.REACHED
    assert drive.least_m > 0.0


def test_what_only_an_ultrasonic_sensor_hears_is_driven_round_until_it_fades() -> None:
    """A pane that no lidar sees, 1.2 m ahead: the path leads round the echo's arc, and straight again after 3 s."""
    drive = hall(pose=Pose2D(1.5, 1.4, 0.0))
    sensor, goal = Pose2D(0.1, 0.0, 0.0), Goal(5.5, 1.4, 0.0)
    drive.run(0.2)
    drive.navigator.take_range(drive.now_s, drive.pose, sensor, 1.1, 0.26)
    for after_s, is_round in ((0.5, True), (2.9, True), (3.1, False)):
        found = drive.navigator.plan_path(drive.pose, goal, drive.now_s + after_s)
        assert isinstance(found, Path)
        away_m = np.hypot(*(found.in_map() - [2.7, 1.4]).T).min()
        assert bool(away_m > 0.18) is is_round, after_s


@pytest.mark.parametrize("speed_m_s", sample([0.3, 0.6, 0.9]))
def test_who_crosses_is_let_pass(speed_m_s: float) -> None:
    """Somebody who looks at nothing walks to and fro across a wide hall: no touch, and the goal is reached."""
    person = Person(np.array([[3.4, 0.5], [3.6, 7.5]]), speed_m_s=speed_m_s, is_blind=True, along_m=2.0)
    walls = box(0, 0, 7.0, 8.0)
    drive = Drive(rasterised(walls, 7.0, 8.0), walls, Pose2D(0.8, 3.9, 0.3), [person])
    assert sent(drive, Goal(6.2, 4.1, 0.0)).end is End.REACHED
    assert drive.least_m > 0.0


@pytest.mark.slow
def test_who_comes_towards_the_robot_in_a_corridor_is_made_way_for() -> None:
    """Somebody blind at 0.2 m/s in a corridor with no room for both: the robot backs off, and is not touched."""
    walls = np.vstack([wall((0, 1.0), (7.0, 1.0)), wall((0, 2.1), (7.0, 2.1))])
    person = Person(np.array([[5.5, 1.55], [2.4, 1.55]]), speed_m_s=0.2, is_blind=True)
    drive = hall(known=(walls,), pose=Pose2D(1.6, 1.5, 0.0), people=[person])
    drive.navigator.navigate_to((Goal(6.5, 1.55, 0.0),))
    drive.run(15.0)
    assert drive.least_m > 0.0
    assert drive.pose.x_m < 2.2


def test_somebody_who_steps_in_front_of_the_robot_is_not_touched() -> None:
    """From behind a pillar, at 0.3 m/s, while the robot drives past."""
    pillar = box(3.0, 1.9, 0.5, 0.5)
    person = Person(np.array([[3.8, 2.6], [3.75, 1.2]]), speed_m_s=0.3, is_blind=False)
    drive = hall(known=(pillar,), people=[person])
    assert sent(drive, Goal(6.2, 1.3, 0.0)).end is End.REACHED
    assert drive.least_m > 0.0


@pytest.mark.slow
def test_a_closed_door_with_another_way_is_gone_around() -> None:
    """Of two doors one is shut, which no map says: it takes the other."""
    walls = np.vstack(
        [wall((3.5, 0), (3.5, 0.5)), wall((3.5, 1.3), (3.5, 1.9)), wall((3.5, 2.7), (3.5, 3.0))]
    )
    shut = wall((3.5, 0.5), (3.5, 1.3))
    drive = hall(shut, known=(walls,), pose=Pose2D(1.0, 0.9, 0.0))
    assert sent(drive, Goal(6.0, 0.9, 0.0)).end is End.REACHED
    assert drive.least_m > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(("leaves_s", "most_m"), [(22.0, 7.0), (60.0, 13.0)])
def test_somebody_in_a_door_is_waited_for_as_long_as_the_way_round_takes(
    leaves_s: float, most_m: float
) -> None:
    """He stands there from 5 s on; through the door it is 5.4 m, round 11 m.

    After 10 s he is furniture. 15 s later the robot goes round him, if he has not left; that it waits is said.
    """
    walls = np.vstack(
        [box(0, 0, 7.0, 8.0), wall((3.5, 0), (3.5, 1.0)), wall((3.5, 1.9), (3.5, 5.0)), wall((3.5, 5.9), (3.5, 8.0))]
    )  # fmt: skip
    person = Standing(np.array([[5.6, 2.6], [3.5, 1.45]]), speed_m_s=0.5, leaves_s=leaves_s)
    drive = Drive(rasterised(walls, 7.0, 8.0), walls, Pose2D(0.8, 1.5, 0.1), [person])
    assert sent(drive, Goal(6.2, 1.3, 0.0)).end is End.REACHED
    assert any(said.startswith("waiting for somebody at (3.") for said in drive.said)
    assert drive.way_m < most_m
    assert (drive.way_m > 10.0) is (leaves_s > 40.0)
    assert drive.least_m > 0.0


@pytest.mark.slow
def test_a_closed_door_without_another_way_ends_blocked_and_each_step_is_said() -> None:
    """It looks, looks for another way, waits, asks, and says for how long it was blocked."""
    walls = np.vstack([wall((3.5, 0), (3.5, 1.0)), wall((3.5, 1.8), (3.5, 3.0))])
    drive = hall(wall((3.5, 1.0), (3.5, 1.8)), known=(walls,))
    end = sent(drive, Goal(6.0, 1.4, 0.0))
    assert end.end is End.BLOCKED
    assert end.reason.startswith("blocked for 2")
    told = " | ".join(drive.said)
    steps = ["looks again", "backs out", "another path", "waits for the way", "asks people"]
    assert [told.index(step) for step in steps] == sorted(told.index(step) for step in steps)
    assert drive.least_m > 0.05


@pytest.mark.slow
def test_a_goal_that_somebody_stands_on_is_driven_near_to_and_waited_for() -> None:
    """The robot waits beside him and says why; once he has gone, the goal is reached."""
    person = Person(np.array([[6.0, 1.4], [6.0, 0.3]]), speed_m_s=0.0)
    drive = hall(people=[person])
    drive.navigator.navigate_to((Goal(6.0, 1.4, 0.5),))
    while not any("something stands at the goal (6.00, 1.40)" in said for said in drive.said):
        drive.tick()
        assert drive.now_s < 60.0
    drive.run(8.0)
    assert not drive.ended
    assert math.hypot(drive.pose.x_m - 6.0, drive.pose.y_m - 1.4) < 1.0
    drive.people.clear()
    drive.run(60.0)
    assert drive.ended[-1].end is End.REACHED
    assert drive.least_m > 0.0


def test_what_the_map_rules_out_is_unreachable_at_once() -> None:
    """A room without a door, a place in a wall, a place outside: no step is driven, and the reason says which."""
    closed = wall((5.0, 0), (5.0, 3.0))
    for goal, told in (
        (Goal(6.0, 1.5), "there is no way to (6.00, 1.50)"),
        (Goal(5.0, 1.5), "is inside an obstacle"),
        (Goal(9.0, 1.5), "is outside of the map"),
    ):
        drive = hall(known=(closed,))
        end = sent(drive, goal, within_s=5.0)
        assert end.end is End.UNREACHABLE
        assert told in end.reason
        assert drive.way_m == 0.0


@pytest.mark.slow
def test_a_tolerance_allows_the_nearest_free_place_and_says_so() -> None:
    """0.1 m from the wall: driven to 0.27 m from it, since 0.2 m are allowed; 0.12 m beside the outline are too far."""
    drive = hall()
    end = sent(drive, Goal(6.9, 1.5, 0.0, tolerance_m=0.2))
    assert end.end is End.REACHED
    assert "nearest free place" in end.reason
    assert drive.pose.x_m == pytest.approx(6.73, abs=0.03)


def test_waypoints_are_reached_in_turn_and_end_with_the_first_that_is_not() -> None:
    """The third is in a wall: two are reached, the fourth is cancelled because of it."""
    drive = hall()
    sent(drive, Goal(1.5, 1.0), Goal(2.0, 2.0), Goal(7.0, 1.5), Goal(1.0, 1.0))
    assert [(end.goal, end.end) for end in drive.ended] == [
        (1, End.REACHED), (2, End.REACHED), (3, End.UNREACHABLE), (4, End.CANCELLED),
    ]  # fmt: skip


def test_a_cancelled_goal_ends_and_the_robot_stands() -> None:
    """The wish is gone with it, and a new goal cancels the one before."""
    drive = hall()
    drive.navigator.navigate_to((Goal(6.0, 1.5),))
    drive.run(4.0)
    drive.navigator.navigate_to((Goal(1.0, 2.0),))
    drive.run(2.0)
    drive.navigator.cancel()
    drive.run(1.0)
    assert [end.end for end in drive.ended] == [End.CANCELLED, End.CANCELLED]
    assert "a new goal replaced it" in drive.ended[0].reason
    assert drive.last.twist is None
    assert drive.navigator.state is GoalState.IDLE
    assert drive.twist.linear_m_s == 0.0


def test_goals_that_are_not_kept_are_cancelled_and_the_others_are_driven_to() -> None:
    """The third of three is taken away on the way to the first, which goes on; then the first."""
    drive = hall()
    drive.navigator.navigate_to((Goal(6.0, 1.5), Goal(1.0, 2.0), Goal(3.0, 2.2)))
    drive.run(2.0)
    path = drive.navigator.planned
    drive.navigator.keep((1, 2))
    drive.run(0.5)
    assert [(each.goal, each.end) for each in drive.ended] == [(3, End.CANCELLED)]
    assert drive.navigator.planned is path
    drive.navigator.keep((2,))
    drive.run(1.0)
    assert [each.goal for each in drive.ended] == [3, 1]
    assert drive.last.progress.goal == 2
    assert drive.navigator.state is GoalState.DRIVING


@pytest.mark.slow
def test_a_pause_gives_the_wheels_away_and_the_goal_goes_on_after_it() -> None:
    """Meanwhile somebody drives the robot elsewhere: it goes on from there."""
    drive = hall()
    drive.navigator.navigate_to((Goal(6.0, 1.5, 0.0),))
    drive.run(4.0)
    drive.navigator.pause("paused by a key")
    drive.run(1.0)
    assert drive.last.twist is None
    assert (drive.last.progress.state, drive.last.progress.reason) == (GoalState.PAUSED, "paused by a key")
    drive.pose = Pose2D(1.0, 2.4, -2.0)
    drive.navigator.resume()
    drive.run(60.0)
    assert [end.end for end in drive.ended] == [End.REACHED]


def test_late_scans_make_it_slow_and_a_gap_makes_it_wait_and_neither_ends_the_goal() -> None:
    """A scan each 0.5 s: slower than 0.29 m/s, but on its way; none for 4 s: it stands, and then goes on."""
    drive = hall()
    drive.navigator.navigate_to((Goal(6.0, 1.5, 0.0),))
    drive.run(4.0)
    begin_m, begin_s = drive.way_m, drive.now_s
    while drive.now_s < begin_s + 4.5:
        drive.lidar_works = drive.ticks % 25 < 5
        drive.tick()
    assert 0.4 < drive.way_m - begin_m < 4.5 * 0.29
    drive.lidar_works = False
    drive.run(4.0)
    assert drive.twist.linear_m_s == 0.0
    drive.lidar_works = True
    drive.run(30.0)
    assert [end.end for end in drive.ended] == [End.REACHED]


def test_a_goal_with_a_speed_limit_is_driven_to_no_faster() -> None:
    """At most 0.1 m/s; and the next goal, which has none, at more than 0.25 m/s."""
    drive = hall()
    drive.navigator.navigate_to((Goal(2.0, 1.5, max_speed_m_s=0.1), Goal(6.0, 1.5, 0.0)))
    while not drive.ended:
        drive.tick()
    assert 0.09 < max(twist.linear_m_s for twist in drive.twists) <= 0.1
    drive.run(30.0)
    assert [end.end for end in drive.ended] == [End.REACHED] * 2
    assert max(twist.linear_m_s for twist in drive.twists) > 0.25


def test_without_scans_it_stands_and_gives_up() -> None:
    """A dead lidar: standing after 0.6 s, a fault after 10 s more."""
    drive = hall()
    drive.navigator.navigate_to((Goal(6.0, 1.5, 0.0),))
    drive.run(4.0)
    drive.lidar_works = False
    drive.run(2.0)
    assert drive.twist.linear_m_s == 0.0
    drive.run(7.0)
    assert not drive.ended
    drive.run(3.0)
    assert drive.ended[-1].end is End.FAULT
    assert "no scan arrived for 10 s" in drive.ended[-1].reason


def test_a_robot_that_is_lost_stands_and_its_goal_ends_lost() -> None:
    """A short while is bridged; 20 s are not."""
    drive = hall()
    drive.navigator.navigate_to((Goal(6.0, 1.5, 0.0),))
    drive.run(3.0)
    drive.status = PoseStatus.LOST
    drive.run(3.0)
    assert drive.twist.linear_m_s == 0.0
    drive.status = PoseStatus.UNCERTAIN
    drive.run(3.0)
    assert 0.0 < drive.twist.linear_m_s <= 0.13
    drive.status = PoseStatus.LOST
    drive.run(25.0)
    assert drive.ended[-1].end is End.LOST


def test_plan_to_drives_nothing() -> None:
    """It tells the way, or why there is none."""
    drive = hall()
    assert isinstance(drive.navigator.plan_path(drive.pose, Goal(7.0, 1.5), 0.0), NoPath)
    path = drive.navigator.plan_path(drive.pose, Goal(6.0, 1.5), 0.0)
    assert isinstance(path, Path)
    assert path.length_m == pytest.approx(5.2, abs=0.1)
    assert drive.navigator.state is GoalState.IDLE


@pytest.mark.parametrize(
    ("goal", "only_for_now"), [(Goal(2.25, 1.5), True), (Goal(7.0, 1.5), False)], ids=["a box", "a wall"]
)
def test_plan_to_tells_what_stands_there_for_now_from_what_is_on_the_map(
    goal: Goal, *, only_for_now: bool
) -> None:
    """A goal where the lidar sees a box that is not on the map can be reached again; one in a wall cannot."""
    drive = hall(box(2.3, 1.3, 0.4, 0.4))
    drive.run(0.2)
    found = drive.navigator.plan_path(drive.pose, goal, drive.now_s)
    assert isinstance(found, NoPath)
    assert found.only_for_now is only_for_now


def test_without_a_map_no_goal_is_accepted() -> None:
    """And the message says what to do."""
    with pytest.raises(NoMapError, match="load or make one"):
        Navigator(ROUND).navigate_to((Goal(1.0, 1.0),))


@pytest.mark.slow
def test_the_same_drive_is_the_same_bit_for_bit() -> None:
    """Nothing is left to chance."""
    ways = []
    for _ in range(2):
        drive = hall(box(3.1, 1.2, 0.45, 0.45, 0.3), seed=5)
        drive.navigator.navigate_to((Goal(6.2, 1.6, 0.4),))
        drive.run(8.0)
        ways.append([(twist.linear_m_s, twist.angular_rad_s) for twist in drive.twists])
    assert ways[0] == ways[1]


def test_an_uncertain_pose_is_no_reason_to_call_a_goal_unreachable() -> None:
    """Somebody said that the robot is where it is not: it stands, and plans again when it is sure."""
    drive = hall()
    here, drive.pose = drive.pose, Pose2D(-3.0, 1.0, 0.4)
    drive.status = PoseStatus.UNCERTAIN
    drive.navigator.navigate_to((Goal(6.0, 1.5),))
    drive.run(4.0)
    assert drive.ended == []
    assert drive.last is not None
    assert drive.last.progress.reason.startswith(
        "waits, because it is not sure of its pose: the robot is outside"
    )
    drive.pose, drive.status = here, PoseStatus.LOCALIZED
    drive.run(3.0)
    assert drive.navigator.state is GoalState.DRIVING


def test_a_pose_that_stays_uncertain_where_there_is_no_way_ends_the_goal_as_lost() -> None:
    """After 20 s, with both reasons."""
    drive = hall()
    drive.pose, drive.status = Pose2D(-3.0, 1.0, 0.4), PoseStatus.UNCERTAIN
    drive.navigator.navigate_to((Goal(6.0, 1.5),))
    drive.run(25.0)
    assert [each.end for each in drive.ended] == [End.LOST]
    assert "for 20 s the pose of the robot was uncertain: the robot is outside" in drive.ended[0].reason


def test_a_robot_whose_map_is_freed_stands_and_drives_on_when_there_is_one_again() -> None:
    """Another map is made ready: at rest within a second, no plan is made, and the goal is there still."""
    drive = hall()
    drive.navigator.navigate_to((Goal(3.0, 1.4),))
    drive.run(3.0)
    assert drive.twist.linear_m_s > 0.2
    drive.navigator.free_map()
    drive.run(1.0)
    assert drive.navigator.world is None
    assert drive.twist.linear_m_s == 0.0
    with pytest.raises(NoMapError, match="there is no map to plan on"):
        drive.navigator.plan_path(drive.pose, Goal(3.0, 1.4), drive.now_s)
    drive.navigator.use_map(drive.grid)
    drive.run(15.0)
    assert [ended.end for ended in drive.ended] == [End.REACHED]
