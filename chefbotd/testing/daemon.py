"""The whole daemon on a virtual clock, with a fake serial device or the simulated robot."""

import asyncio
import contextlib
import random
import ssl
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

from msgspec import field

from chefbotd.app import Daemon
from chefbotd.client import Client
from chefbotd.clock import LoopClock
from chefbotd.component import resolve
from chefbotd.component_list import own_components
from chefbotd.components.simulation.board import BoardRunner
from chefbotd.components.simulation.lidar import LidarRunner
from chefbotd.components.simulation.process.simulated_robot import sim_of, simulation_of
from chefbotd.components.simulation.shared_floor import floor_of, left_where_it_stands
from chefbotd.components.simulation.simulation import board_sender, build_launchpad, build_lidars
from chefbotd.components.simulation.spinning import SpinningLidar
from chefbotd.components.worker.spawn import Spawn
from chefbotd.composition.context import FeatureBuilder
from chefbotd.core.record import Record
from chefbotd.link.port import LinkParameters
from chefbotd.link.reconnect import Opener
from chefbotd.process.build import build
from chefbotd.settings import Settings, load
from chefbotd.testing.transport import FakeSerialDevice
from chefbotd.testing.worker import no_worker

StartWriter: TypeAlias = Callable[[Any, int], Any]
"""Starts what records: ``testing.recording.write_inline`` does so on the same clock."""

NO_LIDARS: Mapping[str, FakeSerialDevice] = MappingProxyType({})


@contextlib.asynccontextmanager
async def running_daemon(
    device: FakeSerialDevice,
    settings: Settings | None = None,
    features: Sequence[FeatureBuilder] = (),
    lidars: Mapping[str, FakeSerialDevice] = NO_LIDARS,
    spawn_worker: Spawn = no_worker,
    start_writer: StartWriter | None = None,
) -> AsyncIterator[Client]:
    """Run the daemon (default: the packaged ChefBot) on ``device``; yields a client connected to its socket.

    ``features`` are further ones, beside those that every robot has. ``lidars`` are what the configured lidars are
    plugged in with, by their names; one that is left out is not plugged in. ``spawn_worker`` starts the worker of a
    robot with a lidar: ``testing.worker.worker_in_process`` runs it on the same clock. ``start_writer`` is what records:
    ``testing.recording.write_inline`` does so on the same clock.

    To be used inside ``chefbotd.clock.run_virtual``. The socket gets a free port of the loopback interface.
    """
    settings = _on_free_port(settings or load())
    rng = random.Random(sim_of(settings).seed)
    opener = _opener(settings, device, lidars)
    daemon = build(
        settings,
        clock=LoopClock(),
        opener=opener,
        rng=rng,
        features=features,
        substitutes=_substitutes(spawn_worker, start_writer),
    )
    async with _running(daemon) as client:
        yield client


def _substitutes(spawn_worker: Spawn, start_writer: StartWriter | None) -> dict[str, Any]:
    """What the worker and the recorder use in place of a process and a thread."""
    return {"worker": spawn_worker, "recording": start_writer}


def _in_loop() -> dict[str, Any]:
    """What components use in place of processes of their own, where all runs on one loop."""
    return {
        component.name: resolve(component.in_loop)
        for component in own_components()
        if component.in_loop is not None
    }


def _opener(settings: Settings, board: FakeSerialDevice, lidars: Mapping[str, FakeSerialDevice]) -> Opener:
    """Opens a lidar's device by its path, and the board's by any other."""
    unplugged = FakeSerialDevice(plugged=False)
    by_path = {lidar.device: lidars.get(lidar.name, unplugged) for lidar in settings.lidar}

    async def open_device(parameters: LinkParameters, protocol: asyncio.BaseProtocol) -> asyncio.Transport:
        return await by_path.get(parameters.device, board).open(parameters, protocol)

    return open_device


class SimulatedLidar(Record, frozen=True):
    """A lidar of the simulated robot: its cable, and what can be wrong with it (``runner.fault``)."""

    device: FakeSerialDevice
    runner: LidarRunner


class SimulatedRobot(Record, frozen=True):
    """A daemon driving the simulated robot: its client, the cable between them, and the board behind it.

    ``board`` has the truth too: the true pose and contact (``truth``), and who and what stands about (``crowd``).
    """

    client: Client
    device: FakeSerialDevice
    board: BoardRunner
    daemon: Daemon
    lidars: Mapping[str, SimulatedLidar] = field(default_factory=dict)

    def now_s(self) -> float:
        """The time of the clock that all of it is on."""
        return asyncio.get_running_loop().time()


@contextlib.asynccontextmanager
async def simulated_robot(
    settings: Settings | None = None,
    *,
    token: str | None = None,
    tls: ssl.SSLContext | None = None,
    spawn_worker: Spawn = no_worker,
    start_writer: StartWriter | None = None,
    features: Sequence[FeatureBuilder] = (),
    config_file: Path | None = None,
) -> AsyncIterator[SimulatedRobot]:
    """The daemon on the simulated robot, both on the running loop's clock, connected through memory.

    ``token`` and ``tls`` are those of ``Client.connect``, where the settings guard the socket. ``spawn_worker`` and
    ``features`` are as for ``running_daemon``. Calibration writes to ``config_file``.
    """
    settings = _on_free_port(settings or load())
    device = FakeSerialDevice()
    simulation = left_where_it_stands(simulation_of(settings))
    send = board_sender(simulation, lambda data: device.feed(data), lambda: device.transport)
    board = BoardRunner(build_launchpad(simulation), send, LoopClock())
    device.on_write = board.receive
    lidars = {name: _in_memory(lidar, board, settings) for name, lidar in build_lidars(simulation).items()}
    loops = [board.run(), *[lidar.runner.run() for lidar in lidars.values()]]
    if (floor := floor_of(simulation)) is not None:
        loops.append(floor.run(board, LoopClock()))
    living = [asyncio.create_task(loop) for loop in loops]
    daemon = build(
        settings,
        clock=LoopClock(),
        opener=_opener(settings, device, {name: lidar.device for name, lidar in lidars.items()}),
        simulated=True,
        rng=random.Random(sim_of(settings).seed),
        substitutes={"simulation": board, **_in_loop(), **_substitutes(spawn_worker, start_writer)},
        config_file=config_file,
        features=features,
    )
    try:
        async with _running(daemon, token, tls) as client:
            yield SimulatedRobot(client, device, board, daemon, lidars)
    finally:
        for task in living:
            await _end(task)


def _in_memory(lidar: SpinningLidar, board: BoardRunner, settings: Settings) -> SimulatedLidar:
    device = FakeSerialDevice()
    seed = sim_of(settings).seed
    runner = LidarRunner(lidar, board, lambda data: device.feed(data), LoopClock(), seed=seed)
    device.on_write = runner.receive
    return SimulatedLidar(device, runner)


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
