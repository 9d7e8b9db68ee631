"""The order of ``chefbotctl serve`` with a robot that does as the test says, on a virtual clock of its own."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from chefbotd.cli.common.exits import ProgramError
from chefbotd.client import CallError
from chefbotd.client.errors import GoalBlocked
from chefbotd.clock import run_virtual
from chefbotd.components.simulation.world import World
from chefbotd.core.geometry import Pose2D
from chefbotd.settings import load, packaged
from examples import order, serve
from examples.legs import Truth, standing_text
from examples.robot_time import STANDS_S, RobotTime
from examples.serve import Serve


class Robot:
    """Goes to each place within 10 s; ``ends`` are what happens at some, ``log`` is all that was asked of it."""

    def __init__(self) -> None:
        self.log: list[str] = []
        self.ends: dict[str, list[Exception | float]] = {}
        self.scene: Any = None
        self.truth: Any = None
        self.found_after_s: float | None = 1.0

    async def import_map(self, path: str, name: str) -> None:
        self.log.append("map")

    async def save_place(self, name: str, x_m: float, y_m: float, heading_rad: float, *, of_map: str) -> None:
        self.log.append(f"place {name}")

    async def load_map(self, name: str) -> None:
        if self.found_after_s is not None:
            asyncio.get_running_loop().call_later(self.found_after_s, self._find)

    def _find(self) -> None:
        self.scene.localization = "localized"

    async def get_map(self, name: str) -> Any:
        class Grid:
            def grid(self) -> None:
                return None

        return Grid()

    async def navigate_to(self, *, place: str) -> str:
        self.log.append(f"to {place}")
        for end in self.ends.pop(place, []):
            if isinstance(end, Exception):
                raise end
            await asyncio.sleep(end)
        await asyncio.sleep(10.0)
        pose = order.PLACES[place]
        self.truth.add_pose(Pose2D(pose.x_m + 0.01, pose.y_m, pose.heading_rad), (), in_contact=False)
        return "reached"

    async def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        self.log.append("turns")

    async def stop(self) -> None:
        self.log.append("stop")

    async def release_control(self) -> None:
        """It has none any more."""

    async def cancel_navigation(self) -> None:
        self.log.append("cancel")


def served(robot: Robot, monkeypatch: pytest.MonkeyPatch, share: float = 1.0) -> Any:
    """What comes of the whole order; the simulated robot's clock goes at this share of the computer's."""

    async def tick(client: Any) -> None:
        """Tell the robot's time 25 times a second of it."""
        while True:
            run._time.take_stamp(1000.0 + share * asyncio.get_running_loop().time())
            await asyncio.sleep(0.04 / share)

    async def nothing(*arguments: Any, **options: Any) -> None:
        await asyncio.sleep(0)

    async def carried_out() -> Any:
        robot.scene, robot.truth = run._scene, run._truth
        run._truth.add_pose(order.START, (), in_contact=False)
        monkeypatch.setattr(serve, "listen", nothing)
        monkeypatch.setattr(serve, "until_ready", nothing)
        monkeypatch.setattr(run, "_watch_truth", tick)
        told = Pose2D(order.START.x_m + 0.03, order.START.y_m, order.START.heading_rad)
        monkeypatch.setattr(type(run._scene.tracker), "pose", property(lambda tracker: told))
        client: Any = robot
        return await run._with_robot(client)

    run = Serve((*order.TABLES, order.HOME), lambda scene: None)
    run._time = RobotTime(lambda: asyncio.get_running_loop().time())
    return run_virtual(carried_out())


def test_the_simulated_robots_configuration_is_one_that_a_daemon_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every key that the order sets in the daemon's environment is there, with such a value."""
    for name, value in order.environment(tmp_path).items():
        monkeypatch.setenv(name, value)
    settings = load(packaged("chefbot_lidar"))
    assert len(settings.sim.people) == len(order.PEOPLE)


def test_three_tables_and_home_are_served_and_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """The order of the legs, each with its end and how far it ended from its place."""
    robot = Robot()
    found = served(robot, monkeypatch)
    assert [leg.place for leg in found.legs] == ["table 1", "table 2", "table 3", "kitchen"]
    assert [entry for entry in robot.log if entry.startswith("to ")] == [
        "to table 1", "to table 2", "to table 3", "to kitchen",
    ]  # fmt: skip
    assert all(leg.off_m == pytest.approx(0.01) for leg in found.legs)
    assert all(leg.seconds == pytest.approx(10.0, abs=0.1) for leg in found.legs)
    assert found.failures == ()
    assert found.late == ""
    assert found.found.off_m == pytest.approx(0.03)
    assert not found.found.turned


def test_a_leg_that_is_not_reached_ends_the_order_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    """The legs before it are told, those after it are not driven."""
    robot = Robot()
    robot.ends["table 2"] = [GoalBlocked(2, "blocked for 61 s: something is in the way")]
    found = served(robot, monkeypatch)
    assert [leg.end for leg in found.legs] == ["reached", "blocked"]
    assert found.failures == ("table 2: blocked for 61 s: something is in the way",)


def test_a_leg_that_takes_too_long_is_cancelled(monkeypatch: pytest.MonkeyPatch) -> None:
    """After 75 s by the robot's clock; what navigation said last is told, and who stands where."""
    robot = Robot()
    robot.ends["table 1"] = [500.0]
    found = served(robot, monkeypatch)
    assert found.legs[0].end == "timed out"
    assert found.legs[0].seconds == pytest.approx(75.0, abs=0.1)
    assert robot.log[-1] == "cancel"
    (told,) = found.failures
    assert told.startswith(
        "table 1: not there within 75 s; last: idle; the robot stands at (2.75, 5.35), 3.40 m"
    )


def test_a_busy_computer_slows_the_clock_and_times_nothing_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """At a fifth of real time, legs of 60 s by the robot's clock take five minutes and are reached, and it is said."""
    robot = Robot()
    robot.ends = {place: [250.0] for place in order.PLACES}
    found = served(robot, monkeypatch, share=0.2)
    assert [leg.end for leg in found.legs] == ["reached"] * 4
    assert all(leg.seconds == pytest.approx(52.0, abs=0.2) for leg in found.legs)
    assert found.late == "the computer is busy: the simulated robot's clock goes at 20 % of real time"


def test_a_clock_that_stands_still_is_not_waited_for_without_end() -> None:
    """Its daemon hangs: no stamp comes for two minutes."""

    async def run() -> float:
        clock, began_s = RobotTime(), asyncio.get_running_loop().time()
        clock.take_stamp(1000.0)
        with pytest.raises(TimeoutError):
            async with clock.timeout(1.0):
                await asyncio.Event().wait()
        return asyncio.get_running_loop().time() - began_s

    assert run_virtual(run()) == pytest.approx(STANDS_S)


def test_who_stands_where_is_told_nearest_first() -> None:
    """The robot (0.2 m) at the origin, a person 1 m ahead of 0.25 m, and a chair of 0.2 m beside it at 0.5 m."""
    truth = Truth(
        World([(50.0, -50.0, 50.0, 50.0)]), 0.2, pose=Pose2D(), discs=((1.0, 0.0, 0.25), (0.0, -0.5, 0.2))
    )
    assert standing_text(truth, Pose2D(3.0, 4.0)) == (
        "the robot stands at (0.00, 0.00), 5.00 m from the goal; people and things stand at "
        "(0.00, -0.50), 0.10 m from it; (1.00, 0.00), 0.55 m from it"
    )


def test_an_error_of_the_robot_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is refused is not repeated."""
    robot = Robot()
    robot.ends["table 1"] = [_error("no_map_loaded")]
    with pytest.raises(CallError, match="no_map_loaded"):
        served(robot, monkeypatch)
    assert robot.log.count("to table 1") == 1


def test_a_robot_that_does_not_find_out_where_it_is_turns_and_then_gives_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It stands for 4 s, turns, and after 40 s says that it is still unknown."""
    robot = Robot()
    robot.found_after_s = None
    with pytest.raises(ProgramError, match="did not find out where it is within 40 s: unknown"):
        served(robot, monkeypatch)
    assert robot.log.count("turns") > 100
    robot = Robot()
    robot.found_after_s = 6.0
    assert served(robot, monkeypatch).found.turned
    assert "stop" in robot.log


def _error(kind: str) -> CallError:
    return CallError(-32000, kind, f"{kind}: as the test says")
