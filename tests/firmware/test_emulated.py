"""The simulated robot with our firmware's own image as its board."""

import asyncio
import random
from pathlib import Path

import pytest

from chefbotd.clock import run_virtual
from chefbotd.components.simulation.process.simulated_robot import simulation_of
from chefbotd.components.simulation.simavr import SimavrBoard
from chefbotd.components.simulation.simulation import build_launchpad
from chefbotd.settings import load
from chefbotd.testing.daemon import simulated_robot
from tests.firmware.emulator import built
from tests.firmware.host import seal
from tests.scenarios.robots import EMULATED, settings_of


@pytest.fixture(autouse=True)
def _built() -> None:
    built()


def lines(cuts_s: list[float]) -> list[tuple[float, bytes]]:
    """What the board sends in a second of driving, when it is advanced to these times."""
    board = build_launchpad(simulation_of(load(overrides={"sim.board.sketch": "emulated"})))
    sent = board.advance(0.2)
    board.receive(seal("hello 1 250 0").encode() + b"\r", 0.2)
    board.receive(seal("s 150 -120 1").encode() + b"\r", 0.21)
    for cut_s in cuts_s:
        sent += board.advance(cut_s)
    return sent + board.advance(1.2)


def test_runs_are_the_same_however_they_are_cut() -> None:
    """At once, or in 100 pieces of any length: the same lines at the same times, to the last microsecond."""
    chance = random.Random(3)
    assert lines(sorted(chance.uniform(0.21, 1.2) for _ in range(100))) == lines([])


def test_a_host_that_falls_silent_leaves_a_robot_that_stands() -> None:
    """Driven with 150 until 2 s, the duty is 0 within 0.26 s of the last line, and the wheels stop."""
    board = build_launchpad(simulation_of(load(overrides={"sim.board.sketch": "emulated"})))
    board.advance(0.2)
    board.receive(seal("hello 1 250 0").encode() + b"\r", 0.2)
    for number in range(1, 37):
        line = seal(f"s 150 150 {number}").encode() + b"\r"
        board.receive(line, 0.2 + 0.05 * number)
    last_s, line_s = 2.0, len(line) * 10 / 115_200
    assert board.truth(last_s, 0.0).twist.linear_m_s > 0.1
    board.advance(last_s + 0.24)
    assert board.sketch.duty == (150, 150)
    board.advance(last_s + 0.002 + 0.26)
    assert board.sketch.duty == (0, 0)
    assert board.heard_s == pytest.approx(last_s + line_s, abs=1e-4)
    assert board.duty_since_s == pytest.approx(board.heard_s + 0.25, abs=0.002)
    assert board.truth(last_s + 0.8, 0.0).twist.linear_m_s == 0


def test_the_daemon_drives_the_image() -> None:
    """The whole daemon on the virtual clock: after two seconds of 0.2 m/s the robot does go that fast."""

    async def run() -> None:
        async with simulated_robot(settings_of(EMULATED, {"safety.guard.enabled": False})) as simulated:
            await asyncio.sleep(1.5)
            for _ in range(40):
                await simulated.client.drive(0.2, 0.0)
                await asyncio.sleep(0.05)
            assert simulated.board.truth(0.0).twist.linear_m_s == pytest.approx(0.2, rel=0.1)

    run_virtual(run())


def test_what_is_not_built_is_named(tmp_path: Path) -> None:
    """The message has both files, and the command that builds them."""
    with pytest.raises(
        FileNotFoundError, match=r"libsimavr_board.so and atmega328p.elf: run `make -C firmware"
    ):
        SimavrBoard(tmp_path)
