"""The daemon on the simulated robot in a thread of its own, in real time, for clients that block."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from chefbotd.settings import load
from chefbotd.testing.daemon import simulated_robot
from tests.waiting import PATIENCE_S


@contextmanager
def simulated_daemon() -> Iterator[int]:
    """Run it as long as the block lasts; yields its port."""
    started, ports = threading.Event(), []
    loop = asyncio.new_event_loop()
    over = asyncio.Event()

    async def serve() -> None:
        # A computer that is busy with other tests must neither disarm the robot nor make a command too old: both have
        # tests of their own.
        patient = {
            "watchdog.latch_after_s": 10.0,
            "watchdog.latch_pauses": 100,
            "safety.command_timeout_s": 2.0,
        }
        settings = load(overrides=patient)
        async with simulated_robot(settings) as robot:
            ports.append((await robot.daemon.server.address())[1])
            started.set()
            await over.wait()

    thread = threading.Thread(target=lambda: loop.run_until_complete(serve()), daemon=True)
    thread.start()
    try:
        assert started.wait(PATIENCE_S), "the simulated daemon did not start"
        yield ports[0]
    finally:
        loop.call_soon_threadsafe(over.set)
        thread.join(PATIENCE_S)
        loop.close()
