"""The end of the recording service."""

import asyncio
from pathlib import Path

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.recording.parameters import RecordingParameters
from chefbotd.components.recording.service import RecordingService
from chefbotd.core.events import LinkOpened


def test_an_end_that_comes_with_the_opening_of_the_port_is_not_lost(tmp_path: Path) -> None:
    """Cancelled in the turn in which the port opens, the service ends before it has loaded anything."""

    def refuse() -> object:
        raise AssertionError("no writer is needed any more")

    async def scenario() -> None:
        bus = Bus()
        parameters = RecordingParameters(ring_s=60.0)
        service = RecordingService(bus, LoopClock(), parameters, tmp_path, refuse, refuse)  # type: ignore[arg-type]
        running = asyncio.create_task(service.run())
        await asyncio.sleep(0.1)
        bus.publish(LinkOpened(0.0, "/dev/ttyACM0"))
        running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await running

    run_virtual(scenario())
