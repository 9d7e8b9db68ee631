"""KHAN on a board that decodes nothing itself: the whole daemon drives by the edges of its encoders."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from chefbotd.clock import run_virtual
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import sample
from tests.scenarios.wires import damage, rewire

Scenario = Callable[[SimulatedRobot], Awaitable[None]]


def on_robot(scenario: Scenario, **overrides: object) -> None:
    """Run a scenario with the board up and nothing to guard against; overrides are ``section__key``."""
    dotted = {key.replace("__", "."): value for key, value in overrides.items()}
    settings = load(
        packaged("khan"), overrides={"robot.wire": "khan_edges", "safety.guard.enabled": False, **dotted}
    )

    async def run() -> None:
        async with simulated_robot(settings) as robot:
            await asyncio.sleep(1.0)
            await scenario(robot)

    run_virtual(run())


async def drive(robot: SimulatedRobot, linear_m_s: float, seconds: float) -> list[float]:
    """Repeat a command at 20 Hz; the true speeds meanwhile."""
    speeds = []
    for _ in range(round(seconds / 0.05)):
        await robot.client.drive(linear_m_s, 0.0)
        await asyncio.sleep(0.05)
        speeds.append(robot.board.truth(0.0).twist.linear_m_s)
    return speeds


async def odometry_is_off_by_m(robot: SimulatedRobot) -> float:
    """Stop, and hold odometry's way against the true one."""
    await robot.client.stop()
    await asyncio.sleep(1.0)
    odometry = (await robot.client.call("get_state"))["topics"]["odometry"]["data"]
    return float(robot.board.truth(0.0).world_from_base.x_m - odometry["x_m"])


@pytest.mark.parametrize(
    ("counts_per_turn", "linear_m_s", "seconds"),
    sample(
        [
            (898, -0.2, 2.0),
            (80, 0.05, 2.0),
            (80, -0.2, 2.0),
            (80, 0.6, 2.0),
            (898, 0.02, 3.0),
            (898, 0.05, 2.0),
            (898, 0.6, 2.0),
            (898, 1.0, 1.5),
        ],
        fast=2,
    ),
)
def test_edges_alone_drive_as_well_as_counts(counts_per_turn: float, linear_m_s: float, seconds: float):
    """With slotted discs and with KHAN's own encoders: the true speed is the one asked for within 2 % and 2 mm/s.

    When it stands again odometry's way is the true one within 5 mm (an edge of the discs is 2.4 mm), and no edge was
    odd or lost.
    """

    async def scenario(robot: SimulatedRobot) -> None:
        speeds = await drive(robot, linear_m_s, seconds)
        assert speeds[-1] == pytest.approx(linear_m_s, rel=0.02, abs=0.002)
        assert await odometry_is_off_by_m(robot) == pytest.approx(0.0, abs=0.005)
        stats = await robot.client.call("get_stats")
        assert {key: stats[key] for key in stats if key.startswith("encoder")} == {
            "encoder_readings_refused": 0,
            "encoder_transitions_illegal": 0,
            "encoder_levels_repeated": 0,
            "encoder_edges_lost": 0,
        }

    on_robot(scenario, encoders__counts_per_turn=counts_per_turn, sim__true__drawn="perfect")


@pytest.mark.parametrize(
    "short",
    sample([{"sim__board__line_rate_bytes_s": 4000.0}, {"sim__board__edge_buffer": 64}]),
    ids=["line", "buffer"],
)
def test_a_board_that_cannot_tell_every_edge_is_not_taken_for_a_slower_robot(short: dict[str, object]):
    """A line of a third of the speed, or too little room on the board, at 1 m/s.

    The robot brakes for want of readings and is never more than a third too fast, while odometry says no more than was
    driven. An e-stop is heard within a cycle, which what is dropped keeps short. Slower it drives on, as well as so few
    cycles a second let it.
    """

    async def scenario(robot: SimulatedRobot) -> None:
        limits = set()
        for _ in range(20):
            assert max(await drive(robot, 1.0, 0.1)) < 1.33
            limits.add((await robot.client.call("get_state"))["safety"]["limited_by"])
        assert "encoders_stale" in limits
        while not any(robot.board.duty):
            await drive(robot, 1.0, 0.05)
        await robot.client.estop("test")
        await asyncio.sleep(0.3)
        assert not any(robot.board.duty)
        await robot.client.arm()
        assert await odometry_is_off_by_m(robot) > 0.05
        assert (await robot.client.call("get_stats"))["encoder_edges_lost"] > 100
        speeds = await drive(robot, -0.1, 2.0)
        assert -0.15 < speeds[-1] < -0.05

    on_robot(scenario, **short)


def test_a_lost_line_costs_a_reading_and_is_counted():
    """One ``q`` line of a wheel at 0.3 m/s: its edges are missed by the next, and the robot drives on at its speed."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.3, 1.0)
        feed, left = robot.device.transport.feed, [1]

        def lose_one(fields: list[bytes]) -> list[bytes] | None:
            if fields[0] == b"0" and left.pop() if left else False:
                return None
            return fields

        rewire(robot, b"q", lose_one)
        speeds = await drive(robot, 0.3, 1.0)
        robot.device.transport.feed = feed
        assert speeds == pytest.approx([0.3] * len(speeds), rel=0.1)
        lost = (await robot.client.call("get_stats"))["encoder_edges_lost"]
        assert 20 <= lost <= 40  # 0.3 m/s are 1429 edges/s, 28 in 20 ms

    on_robot(scenario)


@pytest.mark.parametrize("share", sample(["flip_share", "drop_share", "double_share"]))
def test_one_byte_in_a_thousand_damaged_costs_way_and_no_speed(share: str):
    """Some 15 lines a second are damaged: it drives on at its speed, and what odometry lacks it never makes up."""

    async def scenario(robot: SimulatedRobot) -> None:
        damage(robot, {share: 0.001}, seed=1)
        speeds = await drive(robot, 0.3, 2.5)
        assert max(speeds) < 0.4
        assert speeds[-1] == pytest.approx(0.3, rel=0.1)
        assert (await robot.client.call("get_state"))["safety"]["armed"]
        assert (await robot.client.call("get_stats"))["encoder_edges_lost"] > 0
        assert 0.0 < await odometry_is_off_by_m(robot) < 0.06

    on_robot(scenario)
