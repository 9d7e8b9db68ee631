"""From a path to twists: arcs that are checked, and a pose that is reached."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.components.navigation.algorithms.arcs import check_arc, check_turn, stopping_speed
from chefbotd.components.navigation.algorithms.follower import backwards, follow
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.smooth import resample_path
from chefbotd.components.navigation.algorithms.steering import (
    Control,
    FollowerLimits,
    FollowState,
    Phase,
    Track,
    limit_change,
    predict_pose,
)
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D, wrap_angle
from chefbotd.core.record import replace
from tests.budget import examples

ROUND = Footprint(radius_m=0.18)
OBLONG = Footprint(corners_m=((0.3, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.3, -0.1)))
PARAMS = FollowerLimits()
MIDDLE = Pose2D(5.0, 5.0)
NO_MAP = np.full((200, 200), np.inf, np.float32)


def about(points: list[tuple[float, float]], pose: Pose2D = MIDDLE, margin_m: float = 0.02) -> Surroundings:
    """Points in the robot's frame that stand still, on a map without obstacles."""
    there = np.array(points, float).reshape(-1, 2)
    return Surroundings(there, np.zeros_like(there), np.full(len(there), margin_m), NO_MAP, 0.05, pose)


def straight(near: Surroundings, horizon_m: float = 1.0, outline: Footprint = ROUND) -> float:
    """How far it is free straight on."""
    return check_arc(outline, near, 0.0, horizon_m, 0.3, 0.5).free


def test_straight_on_it_is_free_up_to_the_margin() -> None:
    """A post 0.8 m ahead: 0.8 - 0.18 - 0.02 = 0.6 m, to a step of 2.5 cm; one 0.21 m aside is passed."""
    assert straight(about([(0.8, 0.0)])) == pytest.approx(0.6, abs=0.026)
    assert straight(about([(0.8, 0.21)])) == 1.0
    assert straight(about([(-0.5, 0.0)]), -1.0) == pytest.approx(0.3, abs=0.026)


def test_an_arc_is_checked_along_itself() -> None:
    """With 1 m of radius to the left, (1, 1) is met after a quarter circle less a chord of 0.2 m."""
    near = about([(1.0, 1.0)])
    assert straight(near, 2.0) == 2.0
    met = check_arc(ROUND, near, 1.0, 2.0, 0.3, 0.5).free
    assert met == pytest.approx(math.pi / 2 - 2 * math.asin(0.1), abs=0.03)
    assert check_arc(ROUND, near, -1.0, 2.0, 0.3, 0.5).free == 2.0


def test_a_polygon_turns_with_its_corners() -> None:
    """A post at the left, 0.25 m from the origin: the front, at 0.316 m, reaches it; turning right it does not."""
    post = about([(0.0, 0.25)], margin_m=0.0)
    left = check_turn(OBLONG, post, math.pi / 2).free
    assert left == pytest.approx(math.pi / 2 - math.asin(0.1 / 0.25), abs=0.06)
    assert check_turn(OBLONG, post, -1.0).free == 1.0
    assert check_turn(ROUND, post, math.pi).free == pytest.approx(math.pi)


def test_who_is_too_near_already_may_leave() -> None:
    """A post that nearly touches in front: no step forward, but backward, and turning on the spot."""
    near = about([(0.185, 0.0)])
    assert straight(near) == 0.0
    assert straight(near, -0.5) == 0.5
    assert check_turn(ROUND, near, 2.0).free == 2.0


def test_a_wall_that_no_lidar_sees_stops_by_the_map() -> None:
    """Glass: the map's distance counts, to 6 cm of slack for cell and pose."""
    fixed_m = np.full((200, 200), np.inf, np.float32)
    fixed_m[:] = np.abs((np.arange(200) + 0.5) * 0.05 - 6.025)[None, :]
    near = Surroundings(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), fixed_m, 0.05, Pose2D(5.0, 5.0))
    assert straight(near) == pytest.approx(1.025 - 0.12, abs=0.03)


def test_who_walks_across_is_met_where_he_will_be() -> None:
    """1 m/s from the right: after 0.6 m at 0.3 m/s, two seconds less, he is far; after 0.3 m he is in the way."""
    walking = Surroundings(
        np.array([[0.6, -1.2]]), np.array([[0.0, 0.8]]), np.array([0.05]), NO_MAP, 0.05, Pose2D(5.0, 5.0)
    )
    standing = Surroundings(
        walking.points_m, np.zeros((1, 2)), walking.margin_m, NO_MAP, 0.05, walking.grid_from_base
    )
    assert straight(standing) == 1.0
    assert straight(walking) < 0.5


@pytest.mark.parametrize(
    ("speed_m_s", "ahead_m", "is_free"), [(0.3, 3.3, True), (0.3, 2.6, False), (0.0, 3.3, False)]
)
def test_it_goes_in_front_of_somebody_only_with_time_to_spare(
    speed_m_s: float, ahead_m: float, is_free: bool
) -> None:
    """He crosses 0.5 m ahead at 1 m/s: at 0.3 m/s the robot is past him, by 0.28 m of both, after 2.6 s.

    From 3.3 m he comes 0.7 s later than that; from 2.6 m at once, and a robot that stands needs 0.3 s more.
    """
    near = Surroundings(
        np.array([[0.5, -ahead_m]]), np.array([[0.0, 1.0]]), np.array([0.1]), NO_MAP, 0.05, MIDDLE, speed_m_s=speed_m_s
    )  # fmt: skip
    assert (check_arc(ROUND, near, 0.0, 1.0, 0.3, 0.5, foresight_s=6.0).free == 1.0) is is_free


def test_it_stops_at_no_goal_where_somebody_comes_by() -> None:
    """The goal is 0.4 m ahead, reached after 1.6 s; he is there 0.9 s later, when a robot that went on would be past."""
    near = Surroundings(
        np.array([[0.4, -1.5]]), np.array([[0.0, 0.6]]), np.array([0.1]), NO_MAP, 0.05, MIDDLE, speed_m_s=0.3
    )
    assert check_arc(ROUND, replace(near, stops_m=0.4), 0.0, 1.0, 0.3, 0.5, foresight_s=6.0).free < 0.4


def test_the_speed_falls_with_the_room() -> None:
    """Half of the full room beside, 0.1 m: half way between creeping and full speed, 0.08 and 0.3 m/s."""
    near = about([(0.1 * k, 0.18 + 0.1) for k in range(20)])
    assert check_arc(ROUND, near, 0.0, 1.0, 0.3, 0.5).speed_m_s == pytest.approx(0.19, abs=0.025)
    assert check_arc(ROUND, about([]), 0.0, 1.0, 0.3, 0.5).speed_m_s == 0.3


def test_the_stopping_speed_counts_the_delay_and_the_braking() -> None:
    """0.3 m/s for 0.2 s is 0.06 m; braking at 0.5 m/s2 takes 0.09 m: together 0.15 m."""
    assert stopping_speed(0.15, 0.5, 0.2) == pytest.approx(0.3)
    assert stopping_speed(-0.1, 0.5, 0.2) == 0.0


def test_changes_of_speed_keep_to_the_limits() -> None:
    """0.5 m/s2 for 0.1 s is 0.05 m/s, and 1.8 rad/s2 is 0.18 rad/s; braking may take half more."""
    assert limit_change(PARAMS, STANDING, Twist2D(0.3, -1.0), 0.1) == Twist2D(0.05, pytest.approx(-0.18))
    assert limit_change(PARAMS, Twist2D(0.3, 0.0), STANDING, 0.1).linear_m_s == pytest.approx(0.225)


def test_what_is_in_the_way_is_passed_or_waited_for() -> None:
    """A post on the path is passed on an arc; a wall across it is stopped at."""
    track = Track(resample_path(np.array([[5.0, 5.0], [8.0, 5.0]]), 0.05), None)
    passed = follow(
        Control(PARAMS, ROUND, about([(0.5, -0.05)]), Twist2D(0.2, 0.0), 0.05), FollowState(), track
    )
    assert passed.twist.linear_m_s > 0
    assert passed.twist.angular_rad_s > 0
    assert not passed.is_blocked
    wall = about([(0.22, y) for y in np.linspace(-2, 2, 81)])
    assert follow(Control(PARAMS, ROUND, wall, STANDING, 0.05), FollowState(), track).is_blocked


def driven(
    start: Pose2D, corners: list[tuple[float, float]], heading_rad: float | None
) -> tuple[Pose2D, list[Twist2D]]:
    """A robot with 0.1 s of delay and its real limits, until the follower is done; no obstacles."""
    track = Track(resample_path(np.array(corners), 0.05), heading_rad)
    state, pose, twist, last, queue, said = FollowState(), start, STANDING, STANDING, [STANDING] * 2, []
    for _ in range(2400):
        here = predict_pose(PARAMS, pose, last)
        done = follow(Control(PARAMS, ROUND, about([], here), last, 0.05), state, track)
        state, last = done.state, done.twist
        said.append(last)
        queue.append(last)
        wanted = queue.pop(0)
        linear = twist.linear_m_s + min(max(wanted.linear_m_s - twist.linear_m_s, -0.05), 0.05)
        angular = twist.angular_rad_s + min(max(wanted.angular_rad_s - twist.angular_rad_s, -0.1), 0.1)
        twist = Twist2D(min(linear, 0.34), angular)
        turned, moved = angular * 0.05, twist.linear_m_s * 0.05
        pose = pose.compose(Pose2D(moved * math.cos(turned / 2), moved * math.sin(turned / 2), turned))
        if state.phase is Phase.DONE and abs(twist.linear_m_s) + abs(twist.angular_rad_s) < 1e-6:
            return pose, said
    raise AssertionError(f"never done: {state} at {pose}")


def beside(
    walls: np.ndarray, corners: list[tuple[float, float]], pose: Pose2D, seconds: float = 10.0
) -> tuple[float, Pose2D]:
    """The least room to some points while a robot without delay follows a path, and where it ends."""
    track, state = Track(resample_path(np.array(corners), 0.05), None), FollowState()
    last, least_m = STANDING, np.inf
    for _ in range(round(seconds / 0.05)):
        here = predict_pose(PARAMS, pose, last)
        done = follow(Control(PARAMS, ROUND, _seen(walls, here), last, 0.05), state, track)
        state, last = done.state, done.twist
        pose, least_m = _moved(pose, last), min(least_m, _room_m(walls, pose))
    return least_m, pose


def _seen(walls: np.ndarray, pose: Pose2D) -> Surroundings:
    back = pose.inverse()
    cos, sin = math.cos(back.heading_rad), math.sin(back.heading_rad)
    points = walls @ np.array([[cos, sin], [-sin, cos]]) + [back.x_m, back.y_m]
    return about([(float(x), float(y)) for x, y in points], pose, 0.015)


def _moved(pose: Pose2D, twist: Twist2D) -> Pose2D:
    turned, moved = twist.angular_rad_s * 0.05, twist.linear_m_s * 0.05
    return pose.compose(Pose2D(moved * math.cos(turned / 2), moved * math.sin(turned / 2), turned))


def _room_m(walls: np.ndarray, pose: Pose2D) -> float:
    return float(np.hypot(walls[:, 0] - pose.x_m, walls[:, 1] - pose.y_m).min()) - 0.18


def test_it_keeps_clear_of_a_wall_that_its_path_is_too_near_to() -> None:
    """The path is 6 cm beside the wall, as one round somebody may be: the robot stays 0.10 m from it, and comes on."""
    wall = np.array([(x, 5.24) for x in np.arange(3.0, 9.0, 0.02)])
    least_m, pose = beside(wall, [(4.0, 5.0), (7.0, 5.0)], Pose2D(4.0, 4.9, 0.1))
    assert least_m >= 0.10
    assert pose.x_m > 5.8


def test_it_passes_a_narrow_door_nearer_to_the_middle_than_its_path() -> None:
    """A door 10 cm wider than the robot, the path 3 cm off its middle: 2 cm would be left on that side."""
    posts = np.array([(5.5, 5.0 + side * (0.23 + 0.02 * k)) for k in range(100) for side in (-1, 1)])
    least_m, pose = beside(posts, [(4.0, 5.03), (7.0, 5.03)], Pose2D(4.0, 5.1, -0.2))
    assert least_m > 0.028
    assert pose.x_m > 6.2


def test_it_turns_before_it_drives_where_the_arc_would_take_it_to_a_wall() -> None:
    """0.14 m from a wall that it half faces, its path along that wall: driving in a bend would take 7 cm of these."""
    wall = np.array([(x, 5.32) for x in np.arange(3.0, 9.0, 0.02)])
    least_m, pose = beside(wall, [(5.0, 5.0), (8.0, 5.0)], Pose2D(5.0, 5.0, 0.85))
    assert least_m >= 0.11
    assert pose.x_m > 6.2


def test_it_backs_out_beside_a_wall_without_coming_nearer_than_it_likes() -> None:
    """The trail behind it leads to 4 cm from a wall: going back 0.4 m it stays 0.10 m from it."""
    wall = np.array([(x, 5.34) for x in np.arange(3.0, 7.0, 0.02)])
    pose, last, least_m = Pose2D(5.0, 5.02, 0.0), STANDING, np.inf
    trail = np.stack([np.arange(5.0, 4.0, -0.05), 5.02 + np.arange(20) * 0.01], axis=1)
    for _ in range(90):
        near = _seen(wall, predict_pose(PARAMS, pose, last))
        done = backwards(Control(PARAMS, ROUND, near, last, 0.05), trail)
        last, pose = done.twist, _moved(pose, done.twist)
        least_m = min(least_m, _room_m(wall, pose))
    assert least_m >= 0.10
    assert pose.x_m < 4.6


@given(
    st.floats(-math.pi, math.pi),
    st.floats(-math.pi, math.pi),
    st.floats(0.05, 3.0),
    st.floats(-math.pi, math.pi),
    st.floats(-1.0, 1.0),
)
@settings(max_examples=examples(40))
def test_from_anywhere_the_pose_is_reached(
    heading: float, bearing: float, length: float, end: float, bend: float
) -> None:
    """Within 0.03 m and 3 degrees, near or far, ahead or behind, with a bend on the way, and without swinging about."""
    start = Pose2D(5.0, 5.0, heading)
    goal = (5.0 + length * math.cos(bearing), 5.0 + length * math.sin(bearing))
    middle = (
        (5.0 + goal[0]) / 2 - bend * length / 3 * math.sin(bearing),
        (5.0 + goal[1]) / 2 + bend * length / 3 * math.cos(bearing),
    )
    pose, said = driven(start, [(5.0, 5.0), middle, goal], end)
    assert math.hypot(pose.x_m - goal[0], pose.y_m - goal[1]) < 0.03
    assert abs(wrap_angle(pose.heading_rad - end)) < math.radians(3)
    signs = [math.copysign(1, t.linear_m_s) for t in said if abs(t.linear_m_s) > 0.005]
    assert sum(a != b for a, b in itertools.pairwise(signs)) <= 2


@pytest.mark.parametrize(
    ("start", "goal"),
    [
        (Pose2D(5.0, 5.0, 0.7), (6.7, 5.9)),
        (Pose2D(5.0, 5.0, -2.4), (4.1, 3.7)),
        (Pose2D(5.0, 5.0, 3.0), (5.3, 4.2)),
    ],
)
def test_it_stops_at_the_goal_and_not_where_it_is_near_enough(
    start: Pose2D, goal: tuple[float, float]
) -> None:
    """0.02 m would do, and it drives on: a centimetre of the 0.03 m is left to the noise of the pose."""
    pose, _ = driven(start, [(5.0, 5.0), goal], 1.1)
    assert math.hypot(pose.x_m - goal[0], pose.y_m - goal[1]) < 0.012


def test_curvature_and_speed_keep_to_the_limits() -> None:
    """Round a right angle: no faster than it may, forward or in turning, and no jump from one step to the next."""
    _, said = driven(Pose2D(2.0, 2.0, 0.2), [(2.0, 2.0), (4.0, 2.0), (4.0, 4.0)], None)
    assert max(t.linear_m_s for t in said) <= 0.3 + 1e-9
    assert max(abs(t.angular_rad_s) for t in said) <= 1.2 + 1e-9
    changes = [b.linear_m_s - a.linear_m_s for a, b in itertools.pairwise(said)]
    assert max(changes) <= 0.5 * 0.05 + 1e-9
    assert min(changes) >= -0.75 * 0.05 - 1e-9
