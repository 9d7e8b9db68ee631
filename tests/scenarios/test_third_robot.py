"""A robot that neither ChefBot nor KHAN is, made of a configuration and a row of the wire's table, nothing else."""

import asyncio
import math
import tomllib
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
import tomlkit
from click.testing import CliRunner

from chefbotd.cli.programs.chefbotd import main as chefbotd
from chefbotd.clock import run_virtual
from chefbotd.settings import Settings, load
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from firmware_protocol.codec import ANALOGUE, VARIANTS, Variant
from tests.budget import sample
from tests.robot_files import full
from tests.scenarios.wires import frozen, rewire

ORDERS = ("LLLRRR", "RLLRRL")
RADIUS_M = {"L": 0.03 * 1.05, "R": 0.03 * 0.98}
BACKWARDS_MOTOR, BACKWARDS_ENCODER = 1, 4
CRAWLER = Variant(
    "crawler", wheels=6, banner=("Crawler 3", "ready"), failed_banner=(), extra_from_board=(ANALOGUE,)
)

Scenario = Callable[[SimulatedRobot], Awaitable[None]]


@pytest.fixture(params=sample(ORDERS[::-1]))
def order(request: pytest.FixtureRequest) -> str:
    """The sides of its wheels, as the wire lists them."""
    return str(request.param)


@pytest.fixture
def crawler(order: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Its configuration, from KHAN's: six wheels, one motor and one encoder backwards, an ultrasonic and an infrared."""
    monkeypatch.setitem(VARIANTS, CRAWLER.name, CRAWLER)
    values: dict[str, Any] = tomllib.loads(full("khan").read_text(encoding="utf-8"))
    wheels = [
        {"name": name, "side": "left" if side == "L" else "right", "radius_m": 0.03}
        for name, side in zip(names(order), order, strict=True)
    ]
    wheels[BACKWARDS_MOTOR]["motor_sign"] = -1
    wheels[BACKWARDS_ENCODER]["encoder_sign"] = -1
    values["robot"] = {"name": "crawler", "wire": "crawler"}
    values["chassis"] |= {"wheels": wheels, "left_radius_multiplier": 1.05, "right_radius_multiplier": 0.98}
    values["drive"]["scrub_duty"] = (
        250.0 * 4 / 6 * 2 / 3
    )  # of its weight each wheel has 1/6 for 1/4, and 2 of 3 are dragged
    values["ultrasonic"] = {"name": "sonar", "mount_x_m": 0.1}
    values["infrared"][0] |= {"name": "nose", "channel": 3}
    path = tmp_path / "crawler.toml"
    path.write_text(tomlkit.dumps(values), encoding="utf-8")
    return path


def names(order: str) -> list[str]:
    """What its wheels are called: links_1 is the first on the left, rechts_1 on the right."""
    return [
        f"{'links' if side == 'L' else 'rechts'}_{order[: i + 1].count(side)}" for i, side in enumerate(order)
    ]


def on(settings: Settings, scenario: Scenario) -> None:
    """Run a scenario on the robot, with its board up."""

    async def run() -> None:
        async with simulated_robot(settings) as robot:
            await asyncio.sleep(1.0)
            await scenario(robot)

    run_virtual(run())


async def drive(robot: SimulatedRobot, linear_m_s: float, angular_rad_s: float, seconds: float) -> None:
    """Repeat a command at 20 Hz."""
    for _ in range(round(seconds / 0.05)):
        await robot.client.drive(linear_m_s, angular_rad_s)
        await asyncio.sleep(0.05)


async def topic(robot: SimulatedRobot, name: str) -> Any:
    """A topic's latest data."""
    return (await robot.client.call("get_state"))["topics"][name]["data"]


def test_it_drives_and_turns_and_knows_where_it_is(crawler: Path) -> None:
    """0.2 m/s straight, 1 rad/s on the spot, a curve back: within 3 %, and odometry within 1 cm and 2.4 degrees.

    A plausible robot's track (1 %) and radii (0.3 %) are off by that much of 2.5 rad and of 0.4 m to either side.
    """

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.0, 2.0)
        straight = robot.board.truth(0.0).twist
        assert straight.linear_m_s == pytest.approx(0.2, rel=0.03)
        assert straight.angular_rad_s == pytest.approx(0.0, abs=0.02)
        await drive(robot, 0.0, 1.0, 2.0)
        turning = robot.board.truth(0.0).twist
        assert turning.linear_m_s == pytest.approx(0.0, abs=0.006)
        assert turning.angular_rad_s == pytest.approx(1.0, rel=0.03)
        await drive(robot, -0.2, 0.5, 1.0)
        await robot.client.stop()
        await asyncio.sleep(1.0)
        assert (await topic(robot, "wheels"))["excluded"] == []
        assert (await topic(robot, "safety"))["fault"] is None
        odometry, true = await topic(robot, "odometry"), robot.board.truth(0.0).world_from_base
        assert math.dist((odometry["x_m"], odometry["y_m"]), (true.x_m, true.y_m)) < 0.01
        assert abs(math.remainder(odometry["heading_rad"] - true.heading_rad, math.tau)) < math.radians(2.4)

    on(load(crawler), scenario)


@pytest.mark.parametrize("wheel", sample([0, BACKWARDS_MOTOR, BACKWARDS_ENCODER]))
def test_a_dead_encoder_is_left_out(crawler: Path, order: str, wheel: int) -> None:
    """In mid-drive one wheel's counts stand still: it is named, and odometry goes on without it, within 1 cm."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.0, 1.0)
        rewire(robot, b"e", frozen(wheel))
        await drive(robot, 0.2, 0.3, 1.0)
        assert (await topic(robot, "wheels"))["excluded"] == [names(order)[wheel]]
        odometry, true = await topic(robot, "odometry"), robot.board.truth(0.0).world_from_base
        assert math.dist((odometry["x_m"], odometry["y_m"]), (true.x_m, true.y_m)) < 0.01

    on(load(crawler), scenario)


@pytest.mark.parametrize("wheel", sample(range(6), fast=2))
def test_a_wheel_turns_that_is_named(crawler: Path, order: str, wheel: int) -> None:
    """On a stand, at 6 rad/s: it alone has duty, and rolls its side forward with a third of its rim's speed."""

    async def scenario(robot: SimulatedRobot) -> None:
        for _ in range(40):
            await robot.client.set_wheel_velocities({names(order)[wheel]: 6.0})
            await asyncio.sleep(0.05)
        assert [index for index, duty in enumerate(robot.board.duty) if duty] == [wheel]
        twist, side_m_s = robot.board.truth(0.0).twist, 6.0 * RADIUS_M[order[wheel]] / 3
        assert twist.linear_m_s == pytest.approx(side_m_s / 2, rel=0.05)
        leftward = 1 if order[wheel] == "R" else -1
        assert twist.angular_rad_s == pytest.approx(leftward * side_m_s / 0.189, rel=0.05)
        turning = dict(zip(names(order), (await topic(robot, "wheels"))["velocity_rad_s"], strict=True))
        assert turning.pop(names(order)[wheel]) == pytest.approx(6.0, rel=0.05)
        assert set(turning.values()) == {0.0}

    on(load(crawler, overrides={"sim.body.mass_kg": 0.0}), scenario)


def test_both_its_range_sensors_see(crawler: Path) -> None:
    """The wall ahead is 0.04 m nearer to the ultrasonic at 0.1 m than to the infrared at 0.06 m, each by its name."""

    async def scenario(robot: SimulatedRobot) -> None:
        ranges = {each["sensor"]: each for each in (await topic(robot, "ranges"))["ranges"]}
        assert {name: each["status"] for name, each in ranges.items()} == {"sonar": "ok", "nose": "ok"}
        assert ranges["nose"]["range_m"] - ranges["sonar"]["range_m"] == pytest.approx(0.04, abs=0.03)

    on(load(crawler, overrides={"sim.world.start_x_m": 2.0, "sim.world.start_y_m": 0.8}), scenario)


def test_its_banner_is_known(crawler: Path) -> None:
    """A reset prints this robot's banner, and the daemon takes it for a restart."""

    async def scenario(robot: SimulatedRobot) -> None:
        await robot.client.reset_board()
        await asyncio.sleep(3.0)
        safety = await topic(robot, "safety")
        assert (safety["fault"], safety["reason"]) == (
            "board_restarted",
            "the board restarted: it printed 'Crawler 3'",
        )

    on(load(crawler), scenario)


def test_its_configuration_is_found_good(crawler: Path, order: str) -> None:
    """``check-config`` takes it, and prints each wheel as it is configured."""
    result = CliRunner().invoke(chefbotd, ["check-config", "--all", str(crawler)])
    assert result.exit_code == 0, result.stderr
    for name in names(order):
        assert f'chassis.wheels.{name}.name = "{name}"' in result.output
    assert "sim.body.wheels_per_side" not in result.output
