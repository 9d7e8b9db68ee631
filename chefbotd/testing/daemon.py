"""The whole daemon on a virtual clock: in front of a fake serial device, or of the simulated robot."""

import asyncio
import contextlib
import random
import ssl
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass

from chefbotd.app import Daemon, FeatureBuilder
from chefbotd.client import Client
from chefbotd.clock import LoopClock
from chefbotd.process.build import build
from chefbotd.process.simulated_robot import simulation_of
from chefbotd.settings import Settings, load
from chefbotd.sim.board import BoardRunner
from chefbotd.sim.simulation import board_sender, build_launchpad
from chefbotd.testing.transport import FakeSerialDevice


@contextlib.asynccontextmanager
async def running_daemon(
    device: FakeSerialDevice, settings: Settings | None = None, features: Sequence[FeatureBuilder] = ()
) -> AsyncIterator[Client]:
    """Run the daemon (default: the packaged ChefBot) on ``device``; yields a client connected to its socket.

    ``features`` are further ones, beside those that every robot has.

    To be used inside ``chefbotd.clock.run_virtual``. The socket gets a free port of the loopback interface.
    """
    settings = _on_free_port(settings or load())
    rng = random.Random(settings.sim.seed)
    daemon = build(settings, clock=LoopClock(), opener=device.open, rng=rng, features=features)
    async with _running(daemon) as client:
        yield client


@dataclass(frozen=True, slots=True)
class SimulatedRobot:
    """A daemon driving the simulated robot: its client, the cable between them, and the board behind it."""

    client: Client
    device: FakeSerialDevice
    board: BoardRunner
    daemon: Daemon


@contextlib.asynccontextmanager
async def simulated_robot(
    settings: Settings | None = None, *, token: str | None = None, tls: ssl.SSLContext | None = None
) -> AsyncIterator[SimulatedRobot]:
    """The daemon on the simulated robot, both on the running loop's clock and with nothing but memory between.

    ``token`` and ``tls`` are those of ``Client.connect``, where the settings guard the socket.
    """
    settings = _on_free_port(settings or load())
    device = FakeSerialDevice()
    simulation = simulation_of(settings)
    send = board_sender(simulation, lambda data: device.feed(data), lambda: device.transport)
    board = BoardRunner(build_launchpad(simulation), send, LoopClock())
    device.on_write = board.receive
    living = asyncio.create_task(board.run())
    daemon = build(
        settings, clock=LoopClock(), opener=device.open, simulated=True, rng=random.Random(settings.sim.seed)
    )
    try:
        async with _running(daemon, token, tls) as client:
            yield SimulatedRobot(client, device, board, daemon)
    finally:
        await _end(living)


@contextlib.asynccontextmanager
async def _running(
    daemon: Daemon, token: str | None = None, tls: ssl.SSLContext | None = None
) -> AsyncIterator[Client]:
    task = asyncio.create_task(daemon.run())
    try:
        host, port = await daemon.server.address()
        async with Client.connect(host, port, token=token, tls=tls) as client:
            yield client
    finally:
        await _end(task)


async def _end(task: "asyncio.Task[None]") -> None:
    task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await task


def _on_free_port(settings: Settings) -> Settings:
    api = settings.api.model_copy(update={"host": "127.0.0.1", "port": 0})
    return settings.model_copy(update={"api": api})
