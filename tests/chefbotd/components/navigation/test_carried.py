"""A robot that was carried to a room that looks the same: it does not take the wrong room's walls for people's."""

import math
from collections.abc import Generator, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chefbotd.clock import ManualClock
from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.components.localization.parameters import LocalizationSection
from chefbotd.components.localization.pose_file import SavedPose
from chefbotd.components.localization.skill import LocalizationSkill
from chefbotd.components.localization.skill_requests import LocalizationSkillParameters, SetPose, UseMap
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.navigation.algorithms.arrival import ArrivalData, ArrivalState
from chefbotd.components.navigation.parameters import NavigationSection
from chefbotd.components.navigation.skill import NavigationSkill
from chefbotd.components.navigation.skill_requests import (
    GoalAsked,
    NavigateTo,
    NavigationSkillParameters,
    Stepped,
)
from chefbotd.components.worker.messages import pack_body
from chefbotd.core.geometry import Pose2D, Twist2D
from tests.chefbotd.components.localization.algorithms.buildings import drawn, three_equal_rooms
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, box, cast, wall
from tests.chefbotd.components.worker.skills.drives import moving, turn

RADIUS_M, STEP_S = 0.18, 0.1
BEARINGS = math.tau / 360 * np.arange(360) - math.pi
MAX_RANGE_M = 12.0
WALLS, NOTHING = three_equal_rooms(), np.zeros((0, 4))
MIDDLE_M = 1.5
"""Of a room; they are 3 m apart, and their doors lead to one corridor at y = 3 to 4.5 m."""


class NoDisk:
    """Keeps no pose."""

    def read(self) -> SavedPose | None:
        """There is none."""
        return None

    def write(self, pose: SavedPose) -> str:
        """Forget it."""
        return ""


class Carried:
    """Localization and navigation of one worker, and a robot that obeys them without delay; its clock is virtual.

    The map knows the walls that are ``mapped``, and not the others.
    """

    def __init__(
        self,
        folder: Path,
        truth: Pose2D,
        believed: Pose2D,
        seed: int,
        mapped: Floats = WALLS,
        unmapped: Floats = NOTHING,
    ) -> None:
        self.clock, self.truth, self.walls = ManualClock(50.0), truth, np.vstack([mapped, unmapped])
        self.odom, self.chance = Pose2D(), np.random.default_rng(seed)
        finder = LocalizationSkillParameters(
            lidars=("top",), folder=folder, localization=LocalizationSection()
        )
        grid = drawn(mapped)
        save(MapStore(folder, 1), "rooms", grid)
        self.finder = LocalizationSkill(
            finder.model_dump_json().encode(), self.clock, lambda name: grid, NoDisk()
        )
        parameters = NavigationSkillParameters(
            folder=folder, radius_m=RADIUS_M, half_length_m=RADIUS_M, half_width_m=RADIUS_M,
            navigation=NavigationSection(), silent_speed_m_s=0.0, guard_stop_m=0.05, guard_clearance_m=0.02,
        )  # fmt: skip
        self.skill = NavigationSkill(parameters.model_dump_json().encode(), self.clock)
        self.skill.connect({"localization": self.finder})
        self.twist, self.said, self.states, self.ends = Twist2D(), [""], [""], [""]
        self.reasons = [""]
        self.arrivals: list[ArrivalData] = []
        self._ask(UseMap("rooms", 1))
        self._ask(SetPose(believed.x_m, believed.y_m, believed.heading_rad))

    def _ask(self, request: Any) -> None:
        answer = self.finder.handle(pack_body(request))
        if isinstance(answer, Generator):
            for _ in answer:
                pass

    def go(self, x_m: float, y_m: float) -> None:
        """A goal for navigation."""
        self.skill.handle(pack_body(NavigateTo((GoalAsked(1, x_m, y_m, None, 0.0),), queue=False)))

    def run(self, for_s: float) -> None:
        """A scan, odometry and a step ten times a second."""
        for _ in range(round(for_s / STEP_S)):
            self.clock.advance(STEP_S)
            now_s = self.clock.now_s()
            pose = np.array([self.truth.x_m, self.truth.y_m, self.truth.heading_rad])
            ranges = cast(self.walls, pose, np.zeros((0, 3)), BEARINGS)
            ranges += self.chance.normal(0, 0.01, len(BEARINGS))
            ranges[ranges > MAX_RANGE_M] = 0.0
            odometry = moving(now_s, np.array([self.odom.x_m, self.odom.y_m, self.odom.heading_rad]), 0.0)
            for skill in (self.finder, self.skill):
                self._hear(skill.take_odometry(odometry))
            self._hear(self.finder.take_scan(turn(now_s, "top", Pose2D(), BEARINGS, ranges)))
            self._hear(self.finder.step(now_s))
            self.twist = Twist2D()
            self._hear(self.skill.step(now_s))
            self._move()

    def _move(self) -> None:
        turned, way_m = self.twist.angular_rad_s * STEP_S, self.twist.linear_m_s * STEP_S
        step = Pose2D(way_m * math.cos(turned / 2), way_m * math.sin(turned / 2), turned)
        self.truth, self.odom = self.truth.compose(step), self.odom.compose(step)

    def _hear(self, messages: Iterable[Any]) -> None:
        for message in messages:
            if isinstance(message, LocalizationChanged):
                self.states.append(message.state)
                self.reasons.append(message.reason)
            elif isinstance(message, Stepped):
                self.twist = message.twist or Twist2D()
                self.said.append(message.now.reason)
                self.arrivals += [message.arrival] if message.arrival else []
                self.ends += [f"{goal.end}: {goal.reason}" for goal in message.ended]

    @property
    def off_m(self) -> float:
        """How far the pose of localization is from the truth."""
        report = self.finder.report
        assert report is not None
        assert report.map_from_base is not None
        x_m, y_m, _ = report.map_from_base.pose
        return math.hypot(x_m - self.truth.x_m, y_m - self.truth.y_m)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("really", "believed"), [(1, 0), (0, 1), (1, 2), (2, 1)])
def test_a_robot_that_was_carried_to_the_next_equal_room_reaches_its_goal_and_asks_nobody(
    tmp_path: Path, really: int, believed: int, seed: int
) -> None:
    """Sure of the wrong room, it is sent down the corridor: it doubts, searches the whole map, says so, and gets there.

    Nobody is asked to clear a wall out of the way, and it never ends as unreachable or blocked.
    """
    at = Pose2D(MIDDLE_M + 3.0 * really, MIDDLE_M, 1.2 + 0.2 * seed)
    robot = Carried(tmp_path, at, Pose2D(MIDDLE_M + 3.0 * believed, MIDDLE_M, at.heading_rad), seed)
    robot.run(3.0)
    robot.go(7.5 if believed < 2 else 1.5, 3.75)
    robot.run(80.0)
    assert robot.ends[-1].startswith("reached"), (robot.ends, robot.said[-1], robot.reasons[-1])
    assert robot.off_m < 0.1
    assert not [sentence for sentence in robot.said if "asks people" in sentence]
    assert [reason for reason in robot.reasons if "the whole map is searched" in reason]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_goal_in_the_door_of_an_equal_room_is_not_reached_by_a_pose_that_is_uncertain(
    tmp_path: Path, seed: int
) -> None:
    """From the wrong room's door the corridor looks otherwise: it searches the whole map first, and then goes there."""
    at = Pose2D(MIDDLE_M + 3.0, MIDDLE_M, 1.2)
    robot = Carried(tmp_path, at, Pose2D(MIDDLE_M, MIDDLE_M, at.heading_rad), seed)
    robot.run(3.0)
    robot.go(1.45, 3.0)
    robot.run(60.0)
    assert robot.ends[-1].startswith("reached"), (robot.ends, robot.said[-1], robot.reasons[-1])
    assert robot.off_m < 0.1
    assert [reason for reason in robot.reasons if "the whole map is searched" in reason]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("really", "believed"), [(1, 0), (0, 1), (1, 2)])
def test_a_goal_inside_an_equal_room_that_was_reached_3_m_off_is_told_to_be_wrong_as_soon_as_the_pose_is_found(
    tmp_path: Path, really: int, believed: int, seed: int
) -> None:
    """Inside the rooms nothing tells them apart. On its way to the next goal it finds out, and how far off it was."""
    at = Pose2D(MIDDLE_M + 3.0 * really, MIDDLE_M, 1.2)
    robot = Carried(tmp_path, at, Pose2D(MIDDLE_M + 3.0 * believed, MIDDLE_M, at.heading_rad), seed)
    robot.run(3.0)
    robot.go(MIDDLE_M + 3.0 * believed + 0.3, MIDDLE_M + 0.4)
    robot.run(10.0)
    assert robot.ends[-1].startswith("reached")
    stood = robot.truth
    robot.go(7.5 if believed < 2 else 1.5, 3.75)
    robot.run(70.0)
    assert [data.arrival for data in robot.arrivals][-1] is ArrivalState.WRONG, robot.arrivals
    wrong = robot.arrivals[-1]
    assert wrong.off_m == pytest.approx(3.0 * abs(really - believed), abs=0.1)
    assert (wrong.x_m, wrong.y_m) == pytest.approx((stood.x_m, stood.y_m), abs=0.1)


HALLWAY = box(0.0, 0.0, 40.0, 2.0)
"""Bare: from its middle the lidar sees neither end, and nothing says how far along it the robot is."""


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("heading_rad", [0.0, 0.7])
def test_no_way_from_a_pose_that_is_uncertain_has_the_whole_map_searched_and_says_why(
    tmp_path: Path, heading_rad: float, seed: int
) -> None:
    """Something closes a bare hallway, whose scans do not confirm the pose: nobody is asked before it has searched."""
    across = wall((22.0, 0.0), (22.0, 2.0))
    at = Pose2D(20.0, 1.0, heading_rad)
    robot = Carried(tmp_path, at, Pose2D(19.0, 1.0, heading_rad), seed, HALLWAY, across)
    robot.run(1.0)
    robot.go(30.0, 1.0)
    robot.run(12.0)
    why = "the whole map is searched: the robot finds no way from a pose that is uncertain"
    assert [reason for reason in robot.reasons if why in reason], (robot.states, robot.said)
    assert "searching" in robot.states
    assert not [sentence for sentence in robot.said if "asks people" in sentence]
