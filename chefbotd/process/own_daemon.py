"""Runs a daemon in this process for the duration of a block, for a program that needs the robot without a service.

It stops the motors in every way that a service does: the dead-man, the watchdog's thread, a stop at every end, and the
stop guard if it is killed. It keeps no latch and no maps, records nothing, announces nothing, starts no worker, serves
no page, and listens on a free port of the loopback interface only.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator

from chefbotd.app import Daemon
from chefbotd.client import Client
from chefbotd.clock import Clock, SystemClock
from chefbotd.link.port import open_port
from chefbotd.link.reconnect import Opener
from chefbotd.process.build import build
from chefbotd.process.stop_guard import stop_guard
from chefbotd.process.watchdog import Watchdog
from chefbotd.rpc.parameters import ApiParameters
from chefbotd.safety.latch import LatchParameters
from chefbotd.settings import Settings
from chefbotd.settings.sections import switched_off
from chefbotd.transport.parameters import PageParameters


def alone(settings: Settings) -> Settings:
    """The same robot without what its service may be using: latch, maps, worker, page, socket, recordings."""
    private = {
        "api": ApiParameters(port=0),
        "page": PageParameters(),
        "latch": LatchParameters(),
        **switched_off(settings, exclusive=True),
    }
    return settings.model_copy(update=private)


@contextlib.asynccontextmanager
async def own_daemon(settings: Settings, *, name: str, opener: Opener = open_port) -> AsyncIterator[Client]:
    """Run it, and yield a client called ``name`` that is connected to it. At the end the motors are told to stop.

    It runs on the caller's loop. Blocking the loop for ``[watchdog] timeout_s`` stops the robot, and may disarm it.
    """
    clock = SystemClock()
    daemon = build(alone(settings), clock=clock, opener=opener)
    async with stop_guard(settings), _watch_daemon(daemon, settings, clock):
        task = asyncio.create_task(daemon.run())
        try:
            host, port = await daemon.server.address()
            async with Client.connect(host, port, name=name) as client:
                yield client
        finally:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task


@contextlib.asynccontextmanager
async def _watch_daemon(daemon: Daemon, settings: Settings, clock: Clock) -> AsyncIterator[None]:
    watchdog = Watchdog(
        settings.watchdog,
        clock,
        daemon.driving,
        daemon.session.stop_from_thread,
        daemon.driving.keeper.report_from_thread,
    )
    with watchdog:
        yield
