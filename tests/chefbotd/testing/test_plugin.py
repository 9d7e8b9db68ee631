"""The pytest plugin, used as its users do."""

import asyncio

import pytest

from chefbotd.clock import run_virtual
from chefbotd.testing.board import ScriptedBoard
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice
from firmware_protocol.messages import BatteryLevel, SetDuty, UltrasonicDistance


def test_the_documented_example_works(serial_device: FakeSerialDevice, scripted_board: ScriptedBoard):
    """The example of docs/testing.md: a scripted board, the whole daemon, a client; no hardware, no waiting."""

    async def scenario() -> None:
        async with running_daemon(serial_device) as robot:
            scripted_board.cycle(0, 0)
            await robot.drive(0.2, 0.0)
            await asyncio.sleep(0.05)
            left, right = scripted_board.duty
            assert left == right > 0
            await asyncio.sleep(2.0)
            assert scripted_board.duty == (0, 0)

    run_virtual(scenario())


def test_a_script_is_played_at_its_times(serial_device: FakeSerialDevice, scripted_board: ScriptedBoard):
    """Two readings one second apart reach the client one second apart, and raw bytes are sent as they are."""

    async def scenario() -> None:
        async with running_daemon(serial_device) as robot:
            start_s = asyncio.get_running_loop().time()
            await scripted_board.play(
                [(0.5, UltrasonicDistance(100)), (1.5, b"u\t200\n"), (1.5, BatteryLevel(3000.0))]
            )
            await asyncio.sleep(0)
            assert asyncio.get_running_loop().time() - start_s == pytest.approx(1.5)
            state = await robot.call("get_state")
            assert state["topics"]["ranges"]["data"]["ranges"][0]["range_m"] == 2.0
            assert state["topics"]["battery"]["seq"] == 1

    run_virtual(scenario())


def test_what_the_daemon_sends_is_decoded_and_timed(
    serial_device: FakeSerialDevice, scripted_board: ScriptedBoard
):
    """The first line is a stop; nothing sent yet is None."""

    async def scenario() -> None:
        assert scripted_board.duty is None
        start_s = asyncio.get_running_loop().time()
        async with running_daemon(serial_device):
            await asyncio.sleep(0.1)
        assert scripted_board.received[0].message == SetDuty((0, 0))
        assert scripted_board.duties[0] == (pytest.approx(start_s, abs=0.01), (0, 0))

    run_virtual(scenario())
