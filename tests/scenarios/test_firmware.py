"""The whole daemon with our own firmware on the board: what only a board can do that stops by itself."""

import asyncio
import random
from collections.abc import Awaitable, Callable
from contextlib import suppress
from itertools import pairwise
from typing import Any

import pytest

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import examples
from tests.scenarios.instruments import Stopwatch
from tests.scenarios.robots import settings_of
from tests.scenarios.wires import damage, opened, transport_of

ROBOT = "chefbot/chefbot"
DEAD_MAN_S = 0.26
MOST_GAP_S = 0.08


def on(scenario: Callable[[SimulatedRobot], Awaitable[None]], **overrides: object) -> None:
    """Run a scenario with the checked mode agreed on."""
    keys = {
        "safety.guard.enabled": False,
        **{key.replace("__", "."): value for key, value in overrides.items()},
    }

    async def run() -> None:
        async with simulated_robot(settings_of(ROBOT, keys)) as robot:
            await asyncio.sleep(1.5)
            await scenario(robot)

    run_virtual(run())


async def drive(robot: SimulatedRobot, linear_m_s: float, angular_rad_s: float, seconds: float) -> None:
    """Repeat a command at 20 Hz."""
    for _ in range(round(seconds / 0.05)):
        await robot.client.drive(linear_m_s, angular_rad_s)
        await asyncio.sleep(0.05)


async def firmware(robot: SimulatedRobot) -> dict[str, Any]:
    """The topic's data."""
    data: dict[str, Any] = (await robot.client.call("get_state"))["topics"]["firmware"]["data"]
    return data


def test_the_mode_is_agreed_on_and_told():
    """Within 1.5 s of the board's start: checked, 250 ms, no damage, and a round trip below two cycles."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.1, 1.0)
        told = await firmware(robot)
        assert (told["mode"], told["deadman_ms"], told["board"]) == ("checked", 250, "host")
        assert (told["crc_errors"], told["deadman_stops"], told["refused"]) == (0, 0, 0)
        assert 0.0 < told["round_trip_s"] < 0.02
        assert abs(told["clock_late_s"]) < 0.02

    on(scenario)


@pytest.mark.parametrize("seed", range(examples(10)))
def test_a_pulled_cable_stops_the_wheels(seed: int):
    """Whenever it is pulled, and whatever was driven: duty 0 within 0.26 s, which no daemon can bring about."""
    chance = random.Random(seed)

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, chance.uniform(0.05, 0.3), chance.uniform(-0.8, 0.8), 1.0)
        await asyncio.sleep(chance.uniform(0.0, 0.3))
        assert any(robot.board.duty)
        robot.device.unplug()
        watch = Stopwatch(robot)
        await asyncio.sleep(1.5)
        await watch.stop()
        assert 0.1 < watch.zero_s < DEAD_MAN_S
        assert robot.board.truth(0.0).twist.linear_m_s == 0.0

    on(scenario)


def test_a_daemon_that_says_nothing_more_stops_the_wheels():
    """The computer is frozen with the cable in: nothing is written, and the duty is 0 within 0.26 s."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.25, -0.3, 1.2)
        robot.device.on_write = lambda data: None
        watch = Stopwatch(robot)
        await drive(robot, 0.25, -0.3, 0.4)
        await watch.stop()
        assert 0.1 < watch.zero_s < DEAD_MAN_S

    on(scenario)


def test_a_duty_is_never_older_than_80_ms_while_the_loop_lives():
    """Driven for three seconds, one in which no encoder line arrives: no two commands on the wire are farther apart."""

    async def scenario(robot: SimulatedRobot) -> None:
        write, feed = robot.device.on_write, transport_of(robot).feed
        written: list[float] = []

        def note(data: bytes) -> None:
            if any(opened(line, b" ")[0].startswith(b"s") for line in data.split(b"\r")):
                written.append(asyncio.get_running_loop().time())
            write(data)

        await drive(robot, 0.2, 0.1, 1.0)
        robot.device.on_write = note
        await drive(robot, 0.2, 0.1, 1.0)
        transport_of(robot).feed = lambda data: None
        await drive(robot, 0.2, 0.1, 0.24)
        transport_of(robot).feed = feed
        await drive(robot, 0.2, 0.1, 1.0)
        assert max(after - before for before, after in pairwise(written)) < MOST_GAP_S

    on(scenario)


@pytest.mark.parametrize("seed", range(examples(3)))
def test_one_flipped_byte_in_a_hundred_moves_nothing_wrongly(seed: int):
    """Both ways, ten seconds: each duty on the motors is one that the daemon wrote; no restart, and it drives on."""

    async def scenario(robot: SimulatedRobot) -> None:
        written = {(0, 0)}

        def note(data: bytes) -> None:
            for line in data.split(b"\r"):
                kind, *fields = opened(line, b" ")[0].split(b" ")
                if kind == b"s":
                    written.add((int(fields[0]), int(fields[1])))
            arrive(data)

        damage(robot, {"flip_share": 0.01}, seed)
        arrive, robot.device.on_write = robot.device.on_write, note
        on_motors = set()
        for step in range(5_000):
            await asyncio.sleep(0.002)
            on_motors.add(robot.board.duty)
            if step % 25 == 0:
                await robot.client.drive(0.2, 0.1 * (step // 500 % 5 - 2))
        assert len(on_motors) > 100
        assert on_motors <= written
        assert robot.daemon.session.restarts.memory.count == 0
        told = await firmware(robot)
        assert told["crc_errors"] > 30

    on(scenario)


@pytest.mark.parametrize("seed", range(examples(2)))
def test_a_line_of_which_a_byte_in_twenty_is_damaged_is_never_driven_without_checksums(seed: int):
    """Both ways, 20 s from the start on: no motion without a seal since the board named itself, and none on the motors.

    A stop without a seal whose zero became another digit is a duty of 9 of 255 at most: it turns no wheel.
    """

    async def run() -> None:
        async with simulated_robot(settings_of(ROBOT, {"safety.guard.enabled": False})) as robot:
            session = robot.daemon.session
            written, unsealed, greeted_s = {(0, 0)}, [], []

            def note(data: bytes) -> None:
                for line in data.split(b"\r"):
                    body, sequence = opened(line, b" ")
                    kind, *fields = body.split(b" ")
                    if kind == b"s":
                        written.add((int(fields[0]), int(fields[1])))
                    if kind == b"s" and sequence is None and session.firmware.memory.is_known:
                        unsealed.append(line)
                    if kind == b"hello":
                        greeted_s.append(asyncio.get_running_loop().time())
                arrive(data)

            damage(robot, {"flip_share": 0.05}, seed)
            arrive, robot.device.on_write = robot.device.on_write, note
            on_motors = set()
            for step in range(10_000):
                await asyncio.sleep(0.002)
                on_motors.add(robot.board.duty)
                if step % 25 == 0:
                    with suppress(CallError):
                        await robot.client.arm()
                        await robot.client.drive(0.2, 0.0)
            assert set(unsealed) <= {b"s 0 0"}
            assert all(abs(value) < 10 for duty in on_motors - written for value in duty)
            assert max(after - before for before, after in pairwise(greeted_s)) < 2.0

    run_virtual(run())


def test_a_fresh_daemon_moves_our_board_by_checked_lines_alone():
    """Driven from the first moment on, counts of our firmware configured: no motion without a seal, and no fault."""

    async def run() -> None:
        async with simulated_robot(settings_of(ROBOT, {"safety.guard.enabled": False})) as robot:
            arrive, written = robot.device.on_write, list[bytes]()

            def note(data: bytes) -> None:
                written.extend(data.split(b"\r")[:-1])
                arrive(data)

            robot.device.on_write = note
            await drive(robot, 0.2, 0.1, 2.0)
            bodies = [opened(line, b" ") for line in written]
            assert {body for body, of in bodies if of is None} <= {b"s 0 0"}
            assert any(body.startswith(b"s") and body != b"s 0 0" for body, of in bodies if of is not None)
            assert (await robot.client.call("get_state"))["safety"]["fault"] is None

    run_virtual(run())


def test_a_board_that_went_back_to_classic_is_won_again():
    """Nothing reaches it for 2.5 s: it is classic then; when it hears again, the checked mode is back in a second."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.1, 1.0)
        write, robot.device.on_write = robot.device.on_write, lambda data: None
        await asyncio.sleep(2.5)
        assert (await firmware(robot))["mode"] == "classic"
        robot.device.on_write = write
        await asyncio.sleep(1.0)
        told = await firmware(robot)
        assert (told["mode"], told["deadman_ms"]) == ("checked", 250)
        await drive(robot, 0.2, 0.1, 1.0)
        assert robot.board.truth(0.0).twist.linear_m_s > 0.15

    on(scenario)


def test_a_restarted_board_is_asked_again():
    """A restart on request: the cause is told, and the mode is checked again when the robot may be armed."""

    async def scenario(robot: SimulatedRobot) -> None:
        await robot.client.reset_board()
        await asyncio.sleep(2.0)
        told = await firmware(robot)
        assert (told["mode"], told["reset_cause"]) == ("checked", "command")
        await robot.client.arm()
        await drive(robot, 0.2, 0.1, 1.0)
        assert robot.board.truth(0.0).twist.linear_m_s > 0.15

    on(scenario)


def test_an_estop_latches_on_the_board_until_the_robot_is_armed():
    """Another program on the port cannot move the robot then; `arm` ends the stop there, too."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.1, 1.0)
        await robot.client.estop("smoke")
        await asyncio.sleep(0.1)
        assert (await firmware(robot))["stops"] == ["estop"]
        robot.board.receive(b"s 100 100\r")
        assert robot.board.duty == (0, 0)
        await robot.client.arm()
        await drive(robot, 0.2, 0.1, 1.0)
        assert (await firmware(robot))["stops"] == []
        assert robot.board.truth(0.0).twist.linear_m_s > 0.15

    on(scenario)


def test_an_estop_of_somebody_else_disarms():
    """A terminal on the board's port says `estop`: the daemon latches `board_stopped`, and `arm` drives on."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.1, 1.0)
        robot.board.receive(b"estop\r")
        await asyncio.sleep(0.1)
        safety = (await robot.client.call("get_state"))["safety"]
        assert (safety["mode"], safety["fault"]) == ("disarmed", "board_stopped")
        with pytest.raises(CallError, match="arm the robot"):
            await robot.client.drive(0.2, 0.0)
        await robot.client.arm()
        await drive(robot, 0.2, 0.1, 1.0)
        assert robot.board.truth(0.0).twist.linear_m_s > 0.15

    on(scenario)


def test_another_dead_man_may_be_configured():
    """`[link] deadman_ms = 100`: the pulled cable stops the wheels within 0.11 s."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.1, 1.0)
        robot.device.unplug()
        watch = Stopwatch(robot)
        await asyncio.sleep(1.0)
        await watch.stop()
        assert 0.05 < watch.zero_s < 0.11

    on(scenario, link__deadman_ms=100)


def test_a_board_that_is_not_asked_runs_on_as_a_classic_sketch():
    """`[link] firmware = "classic"`: no checked mode, no dead-man, and after a pulled cable the duty stays."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.1, 1.0)
        assert (await firmware(robot))["mode"] == "classic"
        robot.device.unplug()
        await asyncio.sleep(1.0)
        assert any(robot.board.duty)

    on(scenario, link__firmware="classic")


def nothing(data: bytes) -> bytes:
    """Nothing of it arrives."""
    return b""


def noise(data: bytes) -> bytes:
    """Other bytes arrive."""
    return random.Random(len(data)).randbytes(len(data))


def flipped(data: bytes) -> bytes:
    """A bit of each byte has flipped."""
    return bytes(byte ^ 1 for byte in data)


def stuck(data: bytes) -> bytes:
    """The line is low."""
    return bytes(len(data))


@pytest.mark.parametrize("driven_s", [0.0, 0.1, 1.0])
@pytest.mark.parametrize(
    ("jam", "wheel_loop"),
    [(nothing, False), (noise, False), (flipped, False), (stuck, False), (nothing, True)],
)
def test_a_jammed_line_to_the_board_is_the_lines_fault(
    jam: Callable[[bytes], bytes], driven_s: float, wheel_loop: bool
):
    """From the first command on, or in mid-drive, nothing comes through whole: the fault names the line within 1.6 s."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.0, driven_s)
        write = robot.device.on_write
        robot.device.on_write = lambda data: write(jam(data))
        with suppress(CallError):
            await drive(robot, 0.2, 0.0, 1.6)
        safety = (await robot.client.call("get_state"))["safety"]
        assert safety["fault"] == "commands_lost"
        assert "the cable" in safety["reason"]
        assert robot.board.duty == (0, 0)

    on(scenario, link__wheel_loop=wheel_loop)


@pytest.mark.parametrize("seed", range(examples(3)))
def test_a_jam_both_ways_blames_no_wheel(seed: int):
    """Nine of ten bytes are noise, either way, after a random time of driving, 4 s: no fault but of the line."""
    chance = random.Random(seed)

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.3, chance.choice([0.0, 0.1, 1.0]))
        feed, write = transport_of(robot).feed, robot.device.on_write

        def jam(data: bytes) -> bytes:
            return bytes(chance.randrange(256) if chance.random() < 0.9 else byte for byte in data)

        transport_of(robot).feed, robot.device.on_write = (
            lambda data: feed(jam(data)),
            lambda data: write(jam(data)),
        )
        with suppress(CallError):
            await drive(robot, 0.2, 0.3, 4.0)
        safety = (await robot.client.call("get_state"))["safety"]
        assert safety["fault"] in ("commands_lost", "encoders_silent", "board_restarted", "link_lost")

    on(scenario)
