"""A board whose echo is lost or stands still while the robot drives."""

import asyncio
import contextlib
from itertools import pairwise

import pytest

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.core import events
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import sample
from tests.scenarios.wires import Rewrite, rewire

DECELERATION_M_S2 = 1.0
"""``limits.linear`` of the packaged ChefBot: braking is as accelerating."""

LOOK_S = 0.002


def stuck() -> Rewrite:
    """An echo that goes on saying what it said first."""
    kept: list[list[bytes]] = []

    def rewrite(duty: list[bytes]) -> list[bytes]:
        kept.append(duty)
        return kept[0]

    return rewrite


def lost() -> Rewrite:
    """An echo that does not come any more."""
    return lambda duty: None


async def drive(
    robot: SimulatedRobot, linear_m_s: float, angular_rad_s: float, seconds: float
) -> list[float]:
    """Repeat a velocity at 20 Hz; the robot's true speed every 2 ms."""
    speeds = []
    for _ in range(round(seconds / 0.05)):
        with contextlib.suppress(CallError):  # an echo that stays wrong is a fault of its own
            await robot.client.drive(linear_m_s, angular_rad_s)
        for _ in range(round(0.05 / LOOK_S)):
            await asyncio.sleep(LOOK_S)
            speeds.append(robot.board.truth(0.0).twist.linear_m_s)
    return speeds


@pytest.mark.parametrize("fault", sample([stuck, lost]))
def test_behind_a_dead_echo_the_robot_slows_as_ever_and_gets_no_faster(fault):
    """At 0.10 m/s in a curve the echo dies. 0.05 m/s is reached at once and as gently as ever, 0.30 m/s not at all."""

    async def run() -> None:
        async with simulated_robot() as robot:
            judged = robot.daemon.bus.subscribe(events.LinkHealthChanged)
            await asyncio.sleep(0.5)
            await drive(robot, 0.10, 0.2, 1.5)
            rewire(robot, b"s", fault())
            slower = await drive(robot, 0.05, 0.1, 1.0)
            assert slower[round(0.3 / LOOK_S)] < 0.075
            assert 0.03 < slower[round(0.6 / LOOK_S)] < 0.06
            means = [sum(slower[n : n + 25]) / 25 for n in range(0, round(0.6 / LOOK_S), 25)]
            assert max(a - b for a, b in pairwise(means)) < 1.6 * DECELERATION_M_S2 * 25 * LOOK_S
            faster = await drive(robot, 0.30, 0.1, 3.0)
            assert max(faster) < 0.11
            settled = [sum(faster[n : n + 25]) / 25 for n in range(250, len(faster) - 25, 25)]
            assert max(b - a for a, b in pairwise(settled)) < 0.02
            assert [judged.take_event().condition for _ in range(len(judged))][:2] == [
                "healthy",
                "echo_stuck",
            ]
            await robot.client.stop()
            await asyncio.sleep(0.6)
            assert robot.board.duty == (0, 0)
            assert robot.board.truth(0.0).twist.linear_m_s == pytest.approx(0.0, abs=1e-3)

    run_virtual(run())


def test_an_echo_that_comes_back_gives_the_speed_back():
    """It says again what is in force: healthy is told, and the ramp goes on from where it stood, within its limit."""

    async def run() -> None:
        async with simulated_robot() as robot:
            judged = robot.daemon.bus.subscribe(events.LinkHealthChanged)
            await asyncio.sleep(0.5)
            await drive(robot, 0.10, 0.2, 1.5)
            feed = robot.device.transport.feed
            rewire(robot, b"s", stuck())
            await drive(robot, 0.30, 0.1, 2.0)
            robot.device.transport.feed = feed
            speeds = await drive(robot, 0.30, 0.1, 2.0)
            assert speeds[-1] == pytest.approx(0.30, abs=0.03)
            means = [sum(speeds[n : n + 25]) / 25 for n in range(0, len(speeds) - 25, 25)]
            assert max(b - a for a, b in pairwise(means)) < 1.6 * DECELERATION_M_S2 * 25 * LOOK_S
            told = [judged.take_event().condition for _ in range(len(judged))]
            assert told == ["healthy", "echo_stuck", "healthy"]

    run_virtual(run())
