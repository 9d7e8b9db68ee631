"""Recorded over real ptys on the real clock, replayed bit for bit: nothing is as regular there as in a simulation."""

import asyncio
import contextlib
import random
import time
from functools import partial
from typing import Any

import pytest
import uvloop

from chefbotd.client import CallError, Client, MotionInterrupted
from chefbotd.clock import SystemClock
from chefbotd.components.simulation.embedded import EmbeddedBoard
from chefbotd.components.simulation.process.simulated_robot import simulation_of
from chefbotd.process.build import build
from chefbotd.settings import Settings, load, packaged
from chefbotd.testing.worker import no_worker
from tests.chefbotd.components.recording.replay.recordings import BusRecorder, replayed
from tests.waiting import PATIENCE_S

pytestmark = [pytest.mark.slow, pytest.mark.realtime]


async def drive(client: Client, linear_m_s: float, angular_rad_s: float, seconds: float) -> None:
    """Drive at moments that no clock is in step with."""
    ends_s = time.monotonic() + seconds
    while time.monotonic() < ends_s:
        with contextlib.suppress(CallError, MotionInterrupted):  # a busy computer, or a fault
            await client.drive(linear_m_s, angular_rad_s)
        await asyncio.sleep(random.uniform(0.005, 0.09))


async def arm(client: Client) -> None:
    """Until it is done: on a busy computer the request may be too old when it is read, or the link be down."""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            with contextlib.suppress(CallError):
                await client.arm()
                return
            await asyncio.sleep(0.1)


async def faulted(client: Client, fault: str) -> None:
    """Wait for a fault to be told."""
    async with asyncio.timeout(PATIENCE_S):
        while (await client.get_state()).safety.fault != fault:  # noqa: ASYNC110 - it is another program
            await asyncio.sleep(0.05)


async def recorded_live(settings: Settings) -> tuple[list[Any], Settings]:
    """What a recorder takes off the bus of a daemon in front of a simulated robot with a lidar."""
    recorder = BusRecorder()
    with EmbeddedBoard(simulation_of(settings), SystemClock()) as board:
        lidars = tuple(
            each.model_copy(update={"device": str(board.lidar_devices[each.name])}) for each in settings.lidar
        )
        link = settings.link.model_copy(update={"device": str(board.device)})
        plugged = settings.model_copy(update={"link": link, "lidar": lidars})
        daemon = build(
            plugged, clock=SystemClock(), features=[recorder.feature], substitutes={"worker": no_worker}
        )
        publish = partial(daemon.entries.observe, daemon.bus)
        task = asyncio.create_task(daemon.run(lambda: board.run(publish)))
        host, port = await daemon.server.address()
        async with Client.connect(host, port) as client:
            await asyncio.sleep(1.5)
            await drive(client, 0.23, -0.41, 1.0)
            await asyncio.sleep(0.6)
            await drive(client, 0.1, 0.9, 0.5)
            await client.estop("a test")
            await arm(client)
            await client.set_pid("right_wheel", kp=17.3)
            await drive(client, -0.1, 0.3, 0.4)
            await client.reset_board()
            await faulted(client, "board_restarted")
            await asyncio.sleep(3.0)
            await arm(client)
            await drive(client, 0.1, 0.0, 0.3)
            board.pty.unplug()
            await faulted(client, "link_lost")
            await asyncio.sleep(0.7)
            board.pty.plug()
            await asyncio.sleep(2.5)
            await arm(client)
            await drive(client, 0.0, 0.7, 0.5)
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
    return recorder.events(), plugged


def test_what_the_real_clock_has_seen_is_replayed_bit_for_bit() -> None:
    """With a lidar, an e-stop, other gains, a restarted board and a pulled cable in it."""
    settings = load(packaged("chefbot_lidar"), overrides={"api.port": 0})
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        events, plugged = runner.run(recorded_live(settings))
    outcome = replayed(events, plugged)
    assert outcome.problems == []
    assert outcome.first is None, str(outcome.first)
    counted = outcome.comparison.counts
    assert counted["WheelsDriven"] > 60
    assert counted["ScanMeasured"] > 20
    assert counted["BoardRestarted"] == 1
    assert counted["LinkClosed"] == 1
