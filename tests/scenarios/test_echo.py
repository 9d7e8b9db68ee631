"""A board whose echo is lost or stands still while the robot drives."""

import asyncio
import contextlib
import random
from collections.abc import Callable, Mapping
from itertools import pairwise

import pytest

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.components.simulation.parameters.sketches import PUBLISHED_SKETCHES
from chefbotd.core import events
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import sample
from tests.scenarios.robots import settings_of
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


JAMS: Mapping[str, Callable[[bytes], bytes]] = {
    "nothing": lambda data: b"",
    "noise": lambda data: random.Random(len(data)).randbytes(len(data)),
    "flipped": lambda data: bytes(byte ^ 1 for byte in data),
    "stuck": lambda data: bytes(len(data)),
}
"""What arrives on a line to the board that is cut, disturbed, at another rate, or shorted."""


@pytest.mark.parametrize("jam", sample(list(JAMS)))
@pytest.mark.parametrize("sketch", sample(PUBLISHED_SKETCHES))
def test_a_sketch_to_which_no_command_comes_has_a_bad_line_and_no_stalled_wheel(sketch, jam):
    """Jammed before the first motion, the board echoes `0 0`: the fault is the line's, and no wheel's."""

    async def run() -> None:
        settings = settings_of(f"chefbot/{sketch.value}", {"safety.guard.enabled": False})
        async with simulated_robot(settings) as robot:
            await asyncio.sleep(1.5)
            write = robot.device.on_write
            robot.device.on_write = lambda data: write(JAMS[jam](data))
            await drive(robot, 0.2, 0.0, 1.6)
            safety = (await robot.client.call("get_state"))["safety"]
            assert safety["fault"] == "commands_lost"
            assert "no command reaches the board: it echoes '0 0'" in safety["reason"]
            assert "cable" in safety["reason"]

    run_virtual(run())


def test_a_line_that_is_jammed_at_rest_is_named_by_the_link_and_blames_no_encoder():
    """It drove and stood for 1 s; then nothing arrives: the link says so within 0.5 s, and blames no wheel."""

    async def run() -> None:
        async with simulated_robot(settings_of("chefbot/tiva", {"safety.guard.enabled": False})) as robot:
            warned = robot.daemon.bus.subscribe(events.DriveWarned)
            await asyncio.sleep(1.5)
            await drive(robot, 0.2, 0.0, 1.0)
            await robot.client.stop()
            await asyncio.sleep(1.0)
            robot.device.on_write = lambda data: None
            await drive(robot, 0.05, 0.0, 0.5)
            health = (await robot.client.call("get_state"))["topics"]["link"]["data"]
            assert health["condition"] == "echo_stuck"
            await drive(robot, 0.05, 0.0, 4.0)
            assert (await robot.client.call("get_state"))["safety"]["fault"] is None
            assert len(warned) == 0

    run_virtual(run())


def test_a_blocked_wheel_of_a_board_that_echoes_speeds_is_the_wheels_fault():
    """Its echo, in metres a second, has shown that it means no duty: zero of it excuses no wheel that stands."""

    async def run() -> None:
        async with simulated_robot(settings_of("chefbot/tiva", {"safety.guard.enabled": False})) as robot:
            await asyncio.sleep(1.5)
            rewire(robot, b"s", lambda duty: [b"%.2f" % (float(share) / 600) for share in duty])
            await drive(robot, 0.2, 0.0, 1.5)
            await robot.client.stop()
            await asyncio.sleep(1.0)
            rewire(robot, b"s", lambda speed: [b"0.00", b"0.00"])
            rewire(robot, b"e", stuck())
            await drive(robot, 0.2, 0.0, 2.6)
            assert (await robot.client.call("get_state"))["safety"]["fault"] == "wheel_stalled"

    run_virtual(run())


def test_a_stalled_wheel_of_a_board_without_an_echo_may_be_the_lines_fault_too():
    """It sends no `s` line: nothing shows whether commands arrive, and the reason says to check the cable, too."""

    async def run() -> None:
        async with simulated_robot(settings_of("chefbot/tiva", {"safety.guard.enabled": False})) as robot:
            rewire(robot, b"s", lost())
            robot.device.on_write = lambda data: None
            await asyncio.sleep(1.5)
            await drive(robot, 0.2, 0.0, 2.6)
            safety = (await robot.client.call("get_state"))["safety"]
            assert safety["fault"] == "wheel_stalled"
            assert "sends no 's' lines" in safety["reason"]

    run_virtual(run())
