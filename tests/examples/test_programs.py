"""The programs for students, each on the simulated robot in the flat, on the virtual clock."""

import asyncio
import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from chefbotd.cli.common.context import beside
from chefbotd.client import CallError, Client
from chefbotd.client.models import ScanData
from chefbotd.clock import run_virtual, suspended_s
from chefbotd.core.events import TruthSimulated
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.testing.daemon import SimulatedRobot
from chefbotd.testing.on_map import localized_robot
from examples import patrol, people, square, wall
from examples.program import run_simulated
from examples.scans import nearest_m, points_of

README = Path(square.__file__).with_name("README.md")


@pytest.mark.slow
def test_the_square_ends_where_it_began() -> None:
    """Within 3 cm by odometry, as it says."""
    said = run_simulated(square.main, square.simulated)
    (off_cm,) = re.findall(r"ended (\d+) cm from its start", said)
    assert int(off_cm) <= 3


@pytest.mark.slow
def test_the_robot_follows_the_wall_and_touches_nothing() -> None:
    """For a minute at 0.5 m, within 5 cm in the middle; by the truth it goes several metres and is never in contact."""
    truths: list[TruthSimulated] = []

    async def watch(robot: SimulatedRobot) -> None:
        while True:
            truths.append(robot.board.truth(robot.now_s()))
            await asyncio.sleep(0.1)

    async def scenario() -> str:
        async with localized_robot("flat", **wall.simulated("flat", 1)) as robot, beside(watch(robot)):
            return await wall.main(robot.client)

    (kept_m,) = re.findall(r"It kept (0\.\d+) m", run_virtual(scenario()))
    assert abs(float(kept_m) - wall.WALL_M) < 0.05
    assert not any(true.in_contact for true in truths)
    places = [(true.world_from_base.x_m, true.world_from_base.y_m) for true in truths]
    assert sum(map(math.dist, places, places[1:])) > 5.0


def test_a_robot_at_a_wall_steers_along_it() -> None:
    """Nearer than asked it turns away, farther it turns to it, something ahead turns it on the spot; no wall: around."""

    def wall_at(y_m: float) -> np.ndarray:
        return np.column_stack((np.linspace(-1.0, 0.5, 151), np.full(151, y_m)))

    assert wall.steer(wall_at(0.5), wall.distance_to_wall(wall_at(0.5))) == (
        0.2,
        pytest.approx(0.0, abs=0.02),
    )
    assert wall.steer(wall_at(0.4), wall.distance_to_wall(wall_at(0.4)))[1] == pytest.approx(-0.2, abs=0.03)
    assert wall.steer(wall_at(0.6), wall.distance_to_wall(wall_at(0.6)))[1] == pytest.approx(0.2, abs=0.03)
    ahead = np.array([[0.6, 0.0], [0.0, 0.5]])
    assert wall.steer(ahead, 0.5) == (0.0, -wall.TURN_RAD_S)
    assert wall.distance_to_wall(np.array([[0.0, -0.5], [2.0, 0.0]])) is None
    assert wall.steer(np.array([[2.0, 0.0]]), None) == (0.2, 0.4)


@pytest.mark.slow
def test_the_patrol_visits_every_place_twice() -> None:
    """Three places, two rounds."""
    assert run_simulated(patrol.main, patrol.simulated) == "6 of 6 visits were made."


@pytest.mark.slow
def test_a_patrol_that_somebody_stops_ends() -> None:
    """It sends no further goal: the robot stands where it was stopped."""

    async def scenario() -> str:
        async with localized_robot("flat", **patrol.simulated("flat", 1)) as robot:

            async def stop() -> None:
                async with robot.client.subscribe("navigation") as events:
                    async for event in events:
                        if event.data.state == "driving":
                            break
                async with Client.connect(*robot.client.address, name="page") as person:
                    await person.stop()

            async with beside(stop()):
                said = await patrol.main(robot.client)
            await asyncio.sleep(5.0)
            navigation = (await robot.client.get_state()).topics["navigation"].data
            assert (navigation.state, navigation.goal) == ("cancelled", 1)
            return said

    said = run_virtual(scenario())
    assert said.startswith("The patrol was stopped in round 1: cancelled: navigation was stopped by page")


@pytest.mark.slow
def test_a_patrol_goes_on_where_a_place_cannot_be_reached() -> None:
    """A place inside a wall: missed in both rounds, with the reason, and the other one is visited."""

    def walled(world: str, seed: int) -> dict[str, object]:
        places = {"inside the wall": Pose2D(9.3, 8.0, 0.0), "sofa": Pose2D(2.6, 4.0, 0.4)}
        return {"start": Pose2D(2.45, 2.6, 2.1), "places": places}

    said = run_simulated(patrol.main, walled).splitlines()
    assert said[0] == "2 of 4 visits were made."
    assert [line.partition(":")[0] for line in said[1:]] == [
        "inside the wall in round 1",
        "inside the wall in round 2",
    ]


@pytest.mark.slow
def test_two_people_in_sight_are_counted_and_the_third_is_not() -> None:
    """Two walk about in its room, one in another."""
    said = run_simulated(people.main, people.simulated)
    (number, times, scans) = map(int, re.findall(r"\d+", said))
    assert number == 2
    assert times > 0.8 * scans


def test_people_are_groups_of_points_away_from_the_map() -> None:
    """A 4 m square of floor, a wall at its left edge: a person counts, a chair's leg and the wall do not."""
    percent = np.zeros((80, 80), np.int8)
    percent[:, 0] = 100
    grid = OccupancyGrid(0.05, Pose2D(-2.0, -2.0, 0.0), percent)
    person = np.column_stack((np.linspace(0.9, 1.2, 8), np.full(8, 0.5)))
    leg, at_wall, outside = [[0.0, 1.5]], [[-1.9, 0.0], [-1.9, 0.1]], [[5.0, 5.0]]
    points = np.concatenate((person, leg, at_wall, outside))
    free = people.is_free(grid, points)
    assert free.tolist() == [True] * 9 + [False] * 3
    (group,) = people.people_in(points[free])
    assert group.tolist() == person.tolist()
    assert people.people_in(points[:0]) == []


def test_points_in_the_map_are_turned_and_moved() -> None:
    """1 m ahead of a robot at (2, 3) that looks left is (2, 4)."""
    (point,) = people.in_map(np.array([[1.0, 0.0]]), Pose2D(2.0, 3.0, np.pi / 2))
    assert point.tolist() == pytest.approx([2.0, 4.0])


def test_a_scan_is_points_in_the_robots_frame() -> None:
    """A lidar 0.1 m ahead, turned to the left: its beam at 0 of 2 m ends at (0.1, 2); no reading is no point."""
    scan = ScanData("top", 0.1, 0.0, np.pi / 2, 0.0, np.pi, None, (2000, 0), 0.1)
    assert points_of(scan).tolist() == [pytest.approx([0.1, 2.0])]
    uneven = ScanData("top", 0.0, 0.0, 0.0, 0.0, None, (0, 1571), (1000, 500), 0.1)
    assert points_of(uneven).ravel().tolist() == pytest.approx([1.0, 0.0, 0.0, 0.5], abs=1e-3)
    assert nearest_m(points_of(uneven), 4).tolist() == pytest.approx([1.0, 0.5, 10.0, 10.0], abs=1e-3)


def test_the_readme_lists_programs_that_there_are() -> None:
    """Each row's link leads somewhere; that no program is missing is another test's."""
    linked = re.findall(r"^\| \[\S+\]\((\S+)\)", README.read_text(), re.MULTILINE)
    assert linked
    assert all((README.parent / path).exists() for path in linked)


class RobotOfThreePlaces:
    """A robot that reaches every place at once; while it goes to the second one, the computer is suspended."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.visited: list[str] = []
        self.stop_number, self.is_stopped = 5, False
        self._monkeypatch = monkeypatch

    async def get_state(self) -> SimpleNamespace:
        """Never stopped."""
        return SimpleNamespace(safety=SimpleNamespace(stop_number=5))

    async def list_places(self) -> SimpleNamespace:
        """Three of them."""
        return SimpleNamespace(places=[SimpleNamespace(name=name) for name in ("sofa", "kitchen", "desk")])

    async def navigate_to(self, place: str, if_stop_number: int) -> None:
        """Be there."""
        if if_stop_number != self.stop_number:
            raise CallError(-32039, "stopped_since", "the robot was stopped since")
        self.visited.append(place)
        self.stop_number += self.is_stopped
        if place == "kitchen":
            self._monkeypatch.setattr(
                "chefbotd.client.sleep_watch.suspended_s", lambda: suspended_s() + 600.0
            )


def test_a_patrol_whose_computer_slept_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """It sends the robot to no further place, and says why."""
    robot = RobotOfThreePlaces(monkeypatch)
    said = run_virtual(patrol.main(cast(Client, robot)))
    assert said == "The patrol ended in round 1: this program did not run for 600 s."
    assert robot.visited == ["sofa", "kitchen"]


def test_a_patrol_whose_robot_was_stopped_between_two_places_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody stopped it and armed it after the first place: it is sent to no further one."""
    robot = RobotOfThreePlaces(monkeypatch)
    robot.is_stopped = True
    said = run_virtual(patrol.main(cast(Client, robot)))
    assert said == "The patrol ended in round 1: the robot was stopped since"
    assert robot.visited == ["sofa"]
