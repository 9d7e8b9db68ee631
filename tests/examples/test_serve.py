"""The order of ``chefbotctl serve`` with a robot that does as the test says, on a virtual clock of its own."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from chefbotd.cli.common.exits import ProgramError
from chefbotd.client import CallError
from chefbotd.client.errors import GoalBlocked
from chefbotd.clock import run_virtual
from chefbotd.core.geometry import Pose2D
from chefbotd.settings import load, packaged
from examples import order, serve
from examples.serve import Serve


class Robot:
    """Goes to each place within 10 s; ``ends`` are what happens at some, ``log`` is all that was asked of it."""

    def __init__(self) -> None:
        self.log: list[str] = []
        self.ends: dict[str, list[Exception | float]] = {}
        self.scene: Any = None
        self.truth: Any = None
        self.found_after_s: float | None = 1.0

    async def wait_until_armed(self) -> None:
        self.log.append("armed")

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


def served(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> Any:
    """What comes of the whole order."""

    async def nothing(*arguments: Any, **options: Any) -> None:
        await asyncio.sleep(0)

    async def run() -> Any:
        run = Serve((*order.TABLES, order.HOME), lambda scene: None)
        robot.scene, robot.truth = run._scene, run._truth
        run._truth.add_pose(order.START, (), in_contact=False)
        monkeypatch.setattr(serve, "listen", nothing)
        monkeypatch.setattr(serve, "until_worker_ready", nothing)
        monkeypatch.setattr(serve.time, "monotonic", asyncio.get_running_loop().time)
        monkeypatch.setattr(run, "_watch_truth", nothing)
        told = Pose2D(order.START.x_m + 0.03, order.START.y_m, order.START.heading_rad)
        monkeypatch.setattr(type(run._scene.tracker), "pose", property(lambda tracker: told))
        client: Any = robot
        return await run._with_robot(client)

    return run_virtual(run())


def test_the_simulated_robots_configuration_is_one_that_a_daemon_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every key that the order sets in the daemon's environment is there, with such a value."""
    for name, value in order.environment(tmp_path).items():
        monkeypatch.setenv(name, value)
    settings = load(packaged("chefbot_lidar"))
    assert settings.watchdog.timeout_s == order.PATIENCE_S
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
    assert all(leg.seconds == pytest.approx(10.0) for leg in found.legs)
    assert found.failures == ()
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
    """After 75 s; what navigation said last is told."""
    robot = Robot()
    robot.ends["table 1"] = [500.0]
    found = served(robot, monkeypatch)
    assert found.legs[0].end == "timed out"
    assert found.legs[0].seconds == pytest.approx(75.0)
    assert robot.log[-1] == "cancel"


def test_a_request_that_is_too_old_is_sent_again_and_other_errors_are_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A busy computer: twice too old, then done. What is refused is not repeated."""
    robot = Robot()
    tried = [_error("too_old"), _error("too_old")]

    async def navigate_to(*, place: str) -> str:
        if tried:
            robot.log.append("again")
            raise tried.pop()
        return await Robot.navigate_to(robot, place=place)

    monkeypatch.setattr(robot, "navigate_to", navigate_to)
    assert served(robot, monkeypatch).failures == ()
    assert robot.log.count("again") == 2
    tried.append(_error("no_map_loaded"))
    with pytest.raises(CallError, match="no_map_loaded"):
        served(robot, monkeypatch)


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
