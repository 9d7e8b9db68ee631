"""The whole daemon with our firmware's own image: the scenarios that its core on a simulated board goes through."""

import asyncio
from collections.abc import Callable
from functools import partial

import pytest

from tests.budget import examples
from tests.firmware.emulator import built
from tests.scenarios import test_firmware as scenarios
from tests.scenarios.robots import EMULATED

SCENARIOS = (
    *[partial(scenarios.test_a_pulled_cable_stops_the_wheels, seed) for seed in range(examples(5))],
    *[
        partial(scenarios.test_one_flipped_byte_in_a_hundred_moves_nothing_wrongly, seed)
        for seed in range(examples(2))
    ],
    scenarios.test_a_daemon_that_says_nothing_more_stops_the_wheels,
    scenarios.test_a_duty_is_never_older_than_80_ms_while_the_loop_lives,
    scenarios.test_a_fresh_daemon_moves_our_board_by_checked_lines_alone,
    scenarios.test_a_board_that_went_back_to_classic_is_won_again,
    scenarios.test_a_restarted_board_is_asked_again,
    scenarios.test_an_estop_latches_on_the_board_until_the_robot_is_armed,
    scenarios.test_an_estop_of_somebody_else_disarms,
    scenarios.test_another_dead_man_may_be_configured,
    scenarios.test_a_board_that_is_not_asked_runs_on_as_a_classic_sketch,
)


def name_of(scenario: Callable[[], None]) -> str:
    """The scenario's, with its seed."""
    if isinstance(scenario, partial):
        return f"{scenario.func.__name__}-{scenario.args[0]}"
    return scenario.__name__


@pytest.fixture(autouse=True)
def _image(monkeypatch: pytest.MonkeyPatch) -> None:
    built()
    monkeypatch.setattr(scenarios, "ROBOT", EMULATED)


@pytest.mark.parametrize("scenario", SCENARIOS, ids=name_of)
def test_the_image_does_what_its_model_does(scenario: Callable[[], None]) -> None:
    """Each holds with the image on the board, to the same limits."""
    scenario()


def test_the_mode_is_agreed_on_and_told() -> None:
    """Within 1.5 s of the board's start: checked, 250 ms, no damage, and a round trip below three cycles."""

    async def scenario(robot: scenarios.SimulatedRobot) -> None:
        await scenarios.drive(robot, 0.2, 0.1, 1.0)
        told = await scenarios.firmware(robot)
        assert (told["mode"], told["deadman_ms"], told["board"]) == ("checked", 250, "atmega328p")
        assert (told["crc_errors"], told["deadman_stops"]) == (0, 0)
        assert told["refused"] <= 1  # the line that comes in while it boots has lost its begin
        assert 0.0 < told["round_trip_s"] < 0.03
        await asyncio.sleep(0.1)
        assert robot.board.truth(0.0).twist.linear_m_s > 0.1

    scenarios.on(scenario)


@pytest.mark.parametrize("driven_s", [0.0, 1.0])
def test_a_jammed_line_to_the_board_is_the_lines_fault(driven_s: float) -> None:
    """A bit of each byte flips on its way, from the first command on or in mid-drive: no wheel is blamed."""
    scenarios.test_a_jammed_line_to_the_board_is_the_lines_fault(scenarios.flipped, driven_s, False)


def test_an_estop_in_a_flood_of_short_lines_is_latched() -> None:
    """For 0.6 s two thirds of the line are lines of one letter: the image reads them all, and the stop among them."""

    async def scenario(robot: scenarios.SimulatedRobot) -> None:
        await scenarios.drive(robot, 0.2, 0.1, 0.5)
        for step in range(300):
            robot.board.receive(b"x\r" * 8)
            if step == 50:
                await robot.client.estop("smoke")
            await asyncio.sleep(0.002)
        await asyncio.sleep(0.3)
        told = await scenarios.firmware(robot)
        assert told["stops"] == ["estop"]
        assert robot.board.duty == (0, 0)
        assert told["overruns"] == 0

    scenarios.on(scenario)
