"""``chefbot-vda5050 check``: our robot passes every case, and a robot that does wrong fails those that say so."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from chefbot_vda5050 import acceptance, agent
from chefbot_vda5050.broker import BrokerParameters
from chefbot_vda5050.cli import main
from chefbot_vda5050.conformance import cases
from chefbot_vda5050.conformance.session import session
from click.testing import CliRunner
from msgspec.structs import replace
from vda5050_fakes import NAME, FakeRobot
from vda5050_mosquitto import mosquitto
from vda5050_online import master, robot_online
from vda5050_orders import HEADER

pytestmark = pytest.mark.usefixtures("version")


def outcomes(
    folder: Path,
    metres: float | None,
    before: Callable[[FakeRobot], Any] = lambda robot: None,
    patience_s: float = 30.0,
    version: str | None = None,
) -> dict[str, str]:
    """The outcome of each case by its title, with the reason of those that failed."""

    async def run() -> dict[str, str]:
        async with mosquitto(folder) as broker, master(broker.port) as now:
            parameters = BrokerParameters("127.0.0.1", broker.port)
            robot = FakeRobot(1.0)
            before(robot)
            async with robot_online(parameters, robot):
                await now.until_state(lambda state: True)
                async with session(parameters, NAME, patience_s, version or HEADER["version"]) as tried:
                    results = await cases.run_all(tried, metres)
        return {one.case.title: f"{one.outcome} {one.text}".strip() for one in results}

    return asyncio.run(run())


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """A state comes every second, and not every 30."""
    monkeypatch.setattr(agent, "STATE_EVERY_S", 1.0)
    monkeypatch.setattr(cases, "STATE_EVERY_S", 1.0)


def test_our_robot_passes_every_case(tmp_path: Path) -> None:
    """Also those that have it drive."""
    assert set(outcomes(tmp_path, 2.0).values()) == {"passed"}


def test_a_robot_of_the_other_version_is_found_out(tmp_path: Path) -> None:
    """It keeps to its own version, and that is not the one which was asked for."""
    spoken, asked = HEADER["version"], {"2.1.0": "3.0.0", "3.0.0": "2.1.0"}[HEADER["version"]]
    found = outcomes(tmp_path, None, patience_s=1.0, version=asked)
    title = "headers: ids grow by one for each topic; version, clock and the robot's name are right"
    assert found[title].endswith(f"is of version {spoken}")


def test_without_move_the_robot_stands(tmp_path: Path) -> None:
    """The cases that would drive are named as not tried; all others pass."""
    robots: list[FakeRobot] = []
    found = outcomes(tmp_path, None, robots.append)
    assert robots[0].driven == []
    assert robots[0].facts.x_m == 0.0
    moving = {one.title for one in cases.CASES if one.moves}
    assert {title for title, outcome in found.items() if outcome.startswith("not tried")} == moving
    assert {outcome for title, outcome in found.items() if title not in moving} == {"passed"}


def test_a_robot_that_takes_every_order_fails_the_refusals(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It takes over what it cannot drive."""

    def takes_all(*_: Any) -> acceptance.Accepted:
        return acceptance.Accepted.NEW

    monkeypatch.setattr(agent.acceptance, "judge", takes_all)
    monkeypatch.setattr(
        agent.order, "accept", lambda vehicle, order, *_, **__: (replace(vehicle, order=order), ())
    )
    found = outcomes(tmp_path, None, patience_s=3.0)
    failed = {title for title, outcome in found.items() if outcome.startswith("failed")}
    assert failed >= {
        "an order with too few edges is refused",
        "an order with an unknown action is refused",
        "an order that begins 1 km away is refused",
        "an order on an unknown map is refused",
    }


def test_the_command_prints_a_table_and_fails_where_there_is_no_robot(tmp_path: Path) -> None:
    """Nobody answers: failed and not tried, and exit code 1."""

    async def run() -> Any:
        async with mosquitto(tmp_path) as broker:
            words = ["check", f"127.0.0.1:{broker.port}", "nobody", "--patience-s", "0.2"]
            return await asyncio.to_thread(CliRunner().invoke, main, words)

    result = asyncio.run(run())
    assert result.exit_code == 1
    assert "failed    6.14" in result.output
    assert "not tried 6.6.4.2" in result.output
