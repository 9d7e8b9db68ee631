"""What a standing robot does when somebody walks towards it."""

import math

import numpy as np
import pytest

from chefbotd.components.navigation.algorithms.evade import evading_twist
from chefbotd.components.navigation.algorithms.evasion import Evasion, evade
from chefbotd.components.navigation.algorithms.grid import Singles
from chefbotd.components.navigation.algorithms.interface import NavigationParameters, PoseStatus, StepInput
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D

ROUND = Footprint(radius_m=0.18)
NO_MAP: Singles = np.full((200, 200), np.inf, np.float32)
FRONT = np.stack([0.22 * np.cos(np.linspace(1.7, 4.6, 14)), 0.22 * np.sin(np.linspace(1.7, 4.6, 14))], axis=1)
SIDES = np.array([(x, y) for x in np.arange(-1.5, 1.6, 0.04) for y in (-0.34, 0.31)])
"""A corridor 0.65 m wide: no room for both."""


def evaded(
    x_m: float,
    y_m: float,
    speed_m_s: float,
    *,
    walls: bool = False,
    away_m: float = 0.1,
    waits: bool = False,
    is_stuck: bool = True,
) -> Twist2D | None:
    """What is done about somebody at (x, y) of the robot's frame who walks straight at it, or waits and did."""
    towards = -np.array([x_m, y_m]) / np.hypot(x_m, y_m) * speed_m_s
    turn = np.arctan2(y_m, x_m)
    front = FRONT @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + [x_m, y_m]
    points = np.vstack([front, SIDES]) if walls else front
    intent = np.zeros_like(points)
    intent[: len(front)] = towards
    near = Surroundings(
        points, np.zeros_like(points) if waits else intent, np.full(len(points), 0.015), NO_MAP, 0.05, Pose2D(5, 5),
        intent,
    )  # fmt: skip
    return evading_twist(ROUND, near, STANDING, away_m, is_stuck=is_stuck)


@pytest.mark.parametrize(("x_m", "y_m"), [(1.6, 0.1), (1.55, -0.2), (-1.6, 0.2)])
def test_where_there_is_room_it_leaves_his_way_sideways(x_m: float, y_m: float) -> None:
    """Somebody faster comes from the front, or from behind: an arc, not straight before him."""
    twist = evaded(x_m, y_m, 0.5)
    assert twist is not None
    assert abs(twist.angular_rad_s) > 0.3


def test_who_is_faster_is_not_fled_from_in_a_corridor_and_who_is_slower_is_made_way_for() -> None:
    """At 0.6 m/s he catches up with 0.25 m/s anyhow: it stands. At 0.2 m/s it backs off, also after 1 m."""
    assert evaded(0.85, 0.0, 0.6, walls=True) is None
    twist = evaded(0.65, 0.0, 0.2, walls=True, away_m=1.0)
    assert twist is not None
    assert twist.linear_m_s < 0.0


def test_it_goes_80_cm_for_somebody_faster_and_no_farther() -> None:
    """After that it stands, and he has to stop or to walk round it."""
    assert evaded(1.6, 0.0, 0.5, away_m=0.79) is not None
    assert evaded(1.6, 0.0, 0.5, away_m=0.81) is None


def test_who_passes_by_or_walks_away_is_no_reason_to_move() -> None:
    """0.6 m beside the robot, and in front of it on his way off."""
    assert evaded(0.9, 0.3, -0.5) is None
    passing, along = FRONT + np.array([1.0, 0.6]), np.tile([-0.5, 0.0], (len(FRONT), 1))
    beside = Surroundings(passing, along, np.full(len(FRONT), 0.1), NO_MAP, 0.05, Pose2D(5, 5))
    assert evading_twist(ROUND, beside, STANDING, 0.0, is_stuck=True) is None


def test_who_waits_for_a_robot_that_cannot_go_on_is_let_by() -> None:
    """Both would wait for ever; a robot that only turns on the spot goes on by itself."""
    assert evaded(0.62, 0.05, 0.5, waits=True) is not None
    assert evaded(0.62, 0.05, 0.5, waits=True, is_stuck=False) is None


@pytest.mark.parametrize(
    ("x_m", "speed_m_s", "brakes"),
    [(0.5, 0.9, True), (0.5, 0.35, False), (-0.2, 0.9, False), (-0.6, 0.9, False)],
)
def test_a_robot_brakes_before_a_touch_unless_standing_is_worse(
    x_m: float, speed_m_s: float, brakes: bool
) -> None:
    """Somebody crosses at 0.9 m/s, and is on the robot's line after 0.83 s; their radii are 0.18 and 0.22 m together.

    By then it has driven 0.22 m, or braked in 0.09 m. He crosses 0.5 m ahead: 0.28 m from a robot that drives on, 0.41 m
    from one that brakes. 0.2 m behind: 0.42 m and 0.29 m, so it drives on. 0.6 m behind there is room for both. Somebody
    at 0.35 m/s is evaded to the end.
    """
    front = FRONT @ np.array([[0.0, 1.0], [-1.0, 0.0]]) + [x_m, 0.83 * speed_m_s]
    walks = np.tile([0.0, -speed_m_s], (len(front), 1))
    near = Surroundings(front, walks, np.full(len(front), 0.1), NO_MAP, 0.05, Pose2D(5, 5))
    drives = Twist2D(0.3, 0.1)
    now = StepInput(0.0, 0.05, Pose2D(5, 5), PoseStatus.LOCALIZED, drives)
    params = NavigationParameters(outline=ROUND)
    _, twist = evade(params, Evasion(), now, near, drives, is_blocked=False)
    assert twist == (None if brakes else drives)


@pytest.mark.parametrize(("behind_m", "evades"), [(1.8, True), (3.2, False)])
def test_a_robot_that_drives_leaves_the_way_of_somebody_faster_behind_it(
    behind_m: float, evades: bool
) -> None:
    """At 1 m/s he is at its back within 2.5 s, whether it stands or drives on at 0.25 m/s; from 3.2 m he is not yet."""
    walks = np.tile([1.0, 0.0], (len(FRONT), 1))
    front = FRONT @ np.array([[-1.0, 0.0], [0.0, 1.0]]) - [behind_m, 0.0]
    near = Surroundings(front, walks, np.full(len(front), 0.1), NO_MAP, 0.05, Pose2D(5, 5))
    drives = Twist2D(0.3, 0.0)
    now = StepInput(0.0, 0.05, Pose2D(5, 5), PoseStatus.LOCALIZED, drives)
    params = NavigationParameters(outline=ROUND)
    evasion, twist = evade(params, Evasion(), now, near, drives, is_blocked=False)
    assert evasion.is_active is evades
    assert (twist != drives) is evades


def made_way(x_m: float, y_m: float, speed_m_s: float, wall_rad: float, wall_m: float) -> tuple[float, float]:
    """How near it comes, within 4 s, to a straight wall so far away in that direction, and to who walks at it."""
    direction = np.array([math.cos(wall_rad), math.sin(wall_rad)])
    along = np.arange(-2.5, 2.5, 0.04)[:, None] * np.array([-direction[1], direction[0]])
    wall, person = along + wall_m * direction, np.array([x_m, y_m])
    walks = -person / np.hypot(*person) * speed_m_s
    pose, last, least_m, person_m = Pose2D(), STANDING, np.inf, np.inf
    for _ in range(80):
        turn = math.atan2(-walks[1], -walks[0])
        front = (
            FRONT @ np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]) + person
        )
        points = np.vstack([front, wall])
        velocity = np.zeros_like(points)
        velocity[: len(front)] = walks
        back = pose.inverse()
        cos, sin = math.cos(back.heading_rad), math.sin(back.heading_rad)
        turned = np.array([[cos, sin], [-sin, cos]])
        near = Surroundings(
            points @ turned + [back.x_m, back.y_m], velocity @ turned, np.full(len(points), 0.015), NO_MAP, 0.05,
            Pose2D(5, 5), velocity @ turned,
        )  # fmt: skip
        away_m = math.hypot(pose.x_m, pose.y_m)
        last = evading_twist(ROUND, near, last, away_m, is_stuck=True) or STANDING
        heading = 0.05 * last.angular_rad_s
        moved = 0.05 * last.linear_m_s
        pose = pose.compose(Pose2D(moved * math.cos(heading / 2), moved * math.sin(heading / 2), heading))
        person = person + 0.05 * walks
        least_m = min(least_m, wall_m - 0.18 - float(direction @ [pose.x_m, pose.y_m]))
        person_m = min(person_m, math.dist(person, (pose.x_m, pose.y_m)) - 0.18 - 0.22)
    return least_m, person_m


@pytest.mark.parametrize(
    ("x_m", "y_m", "speed_m_s", "wall_rad", "wall_m"),
    [(0.3, 0.99, 0.2, 1.76, 0.36), (0.07, -1.34, 0.3, 4.33, 0.37), (0.7, 0.72, 0.2, 2.44, 0.41)],
)
def test_it_makes_way_without_coming_near_a_wall(
    x_m: float, y_m: float, speed_m_s: float, wall_rad: float, wall_m: float
) -> None:
    """0.10 m stay beside it to a wall that was 0.18 m, 0.19 m and 0.23 m away, and he passes."""
    least_m, person_m = made_way(x_m, y_m, speed_m_s, wall_rad, wall_m)
    assert least_m >= 0.10
    assert person_m >= 0.12


def test_it_goes_near_a_wall_rather_than_being_touched() -> None:
    """A corridor that leaves 0.08 m on either side: it backs off in it before somebody slow who walks straight at it."""
    sides = np.array([(x, y) for x in np.arange(-1.5, 1.6, 0.04) for y in (-0.26, 0.26)])
    points = np.vstack([FRONT + np.array([0.6, 0.0]), sides])
    velocity = np.zeros_like(points)
    velocity[: len(FRONT)] = [-0.15, 0.0]
    near = Surroundings(points, velocity, np.full(len(points), 0.015), NO_MAP, 0.05, Pose2D(5, 5), velocity)
    twist = evading_twist(ROUND, near, STANDING, 0.1, is_stuck=True)
    assert twist is not None
    assert twist.linear_m_s < 0.0
