"""The process around the daemon: its loop, its signals, its exit code, and a simulated robot where one is asked for."""

import asyncio
import gc
import os
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Optional

import structlog
import uvloop

from chefbotd.app import Daemon, Loop
from chefbotd.clock import Clock, SystemClock
from chefbotd.composition.context import StartWriter, WorkerSpawn
from chefbotd.extras import how_to_add_extra
from chefbotd.link.board_memory import BoardFile
from chefbotd.process import keep_alive, signals
from chefbotd.process.build import build
from chefbotd.process.exit_deadline import ExitDeadline
from chefbotd.process.stop_guard import stop_guard
from chefbotd.process.watchdog import Watchdog, log_priority, raise_priority
from chefbotd.rpc.access import AccessError
from chefbotd.safety.latch import LatchParameters
from chefbotd.settings import Settings
from chefbotd.shared_clock import SharedClock
from chefbotd.storage import state_folder
from chefbotd.transport.tcp import CannotListen, raise_descriptor_limit, require_descriptors

if TYPE_CHECKING:
    from chefbotd.process.service import DaemonService, Load

log = structlog.get_logger(component="app")

AsService = Callable[[Daemon], Optional["DaemonService"]]
LIBRARIES = {"zstd": "zstandard", "lz4": "lz4"}
"""What each compression of recordings needs."""


def run(
    settings: Settings, *, simulated: bool, load: "Load | None" = None, config_file: Path | None = None
) -> int:
    """Run the daemon until a signal ends it; returns the exit code. ``load`` reads the configuration again, on SIGHUP.

    ``config_file`` is the one that it was read from, None: the packaged one, which calibration does not write to.

    0, 1 after a failure, or 78 when the socket cannot be guarded as configured, or has too few descriptors.
    """
    clock, new_loop = _time_of(settings, simulated=simulated)
    try:
        raise_descriptor_limit()
        require_descriptors(settings.api.reserved_stop_connections)
        with asyncio.Runner(loop_factory=new_loop) as runner:
            runner.run(_until_signalled(settings, load, config_file, clock, simulated=simulated))
    except BaseExceptionGroup as failures:
        for failure in _leaves(failures):
            if isinstance(failure, CannotListen):
                log.error("cannot serve", error=str(failure))
            else:
                log.error("cannot go on", error=repr(failure), exc_info=failure)
        return 1
    except (AccessError, CannotListen) as problem:
        log.error("cannot serve", error=str(problem))
        return os.EX_CONFIG
    return 0


def _time_of(settings: Settings, *, simulated: bool) -> tuple[Clock, Callable[[], asyncio.AbstractEventLoop]]:
    """The clock, and how to make its loop; a simulated robot may share one with others."""
    if not simulated or settings.sim.shared_clock is None:
        return SystemClock(), uvloop.new_event_loop
    from chefbotd.components.simulation.process.shared_loop import (
        SharedClockLoop,  # not in the memory of a daemon on a real robot
    )

    clock = SharedClock(settings.sim.shared_clock)
    return clock, partial(SharedClockLoop, clock)


def _leaves(group: BaseExceptionGroup[BaseException]) -> Iterator[BaseException]:
    for error in group.exceptions:
        if isinstance(error, BaseExceptionGroup):
            yield from _leaves(error)
        else:
            yield error


class _Hangup:
    """What SIGHUP does once the daemon is built; before, it does nothing."""

    service: "DaemonService | None" = None

    def __call__(self) -> None:
        if self.service is not None:
            self.service.want_reload()


async def _until_signalled(
    settings: Settings, load: "Load | None", config_file: Path | None, clock: Clock, *, simulated: bool
) -> None:
    task = asyncio.current_task()
    assert task is not None  # noqa: S101 - a coroutine that runs has a task
    received: list[str] = []
    deadline = ExitDeadline()

    def end(name: str) -> None:
        received.append(name)
        task.cancel()
        if settings.plugins.allow:
            deadline.start(task.get_loop())

    hangup = _Hangup()
    signals.handle(end, hangup if load is not None and keep_alive.is_listening() else None)

    def as_service(daemon: Daemon) -> "DaemonService | None":
        if keep_alive.is_listening():
            from chefbotd.process.service import service_of

            hangup.service = service_of(daemon, settings, load)
        return hangup.service

    try:
        serve = _serve_simulated if simulated else _serve_real
        await serve(settings, as_service, config_file, clock)
    except asyncio.CancelledError:
        if not received:
            raise
    finally:
        keep_alive.notify("STOPPING=1")
        if settings.plugins.allow:
            deadline.start(task.get_loop())
    log.info("stopped", signal=received[0])


async def _serve(
    daemon: Daemon, settings: Settings, as_service: AsService, clock: Clock, *more: Loop
) -> None:
    service = as_service(daemon)
    control = settings.control
    priority = raise_priority(control.realtime_priority, lock_memory=control.lock_memory)

    async def report_ready() -> None:
        host, port = await daemon.server.address()
        freeze_gc()
        log_priority(priority, control.realtime_priority)
        if service is None:
            keep_alive.notify(f"READY=1\nSTATUS=listening on {host}:{port}")
        else:
            service.status.priority = str(priority)
            service.report_ready(f"{host}:{port}")

    watchdog = Watchdog(
        settings.watchdog,
        clock,
        daemon.driving,
        daemon.session.stop_from_thread,
        daemon.driving.keeper.report_from_thread,
        priority.realtime + 1 if priority.realtime else 0,
    )
    with watchdog:
        await daemon.run(report_ready, *(service.loops if service else ()), *more)


async def _serve_real(
    settings: Settings, as_service: AsService, config_file: Path | None, clock: Clock
) -> None:
    """On the robot's port; its latch is kept where systemd offers room, unless the configuration says where."""
    folder = settings.latch.folder or keep_alive.runtime_folder()
    settings = settings.model_copy(update={"latch": LatchParameters(folder=folder)})
    memory = BoardFile(state_folder("boards", os.environ, simulated=False), settings.link.device)
    daemon = build(
        settings,
        clock=clock,
        start_writer=_start_writer(settings),
        config_file=config_file,
        board_memory=memory,
    )
    if folder is None:
        log.info(
            "a restart forgets an e-stop or a fault: neither [latch] folder nor RuntimeDirectory= is set"
        )
    async with stop_guard(settings):
        await _serve(daemon, settings, as_service, clock)


async def _serve_simulated(
    settings: Settings, as_service: AsService, config_file: Path | None, clock: Clock
) -> None:
    from chefbotd.components.simulation.embedded import EmbeddedBoard
    from chefbotd.components.simulation.process.simulated_robot import (
        simulation_of,  # not in the memory of a daemon on a real robot
    )

    with EmbeddedBoard(simulation_of(settings), clock) as board:
        link = settings.link.model_copy(update={"device": str(board.device)})
        lidars = tuple(
            [
                lidar.model_copy(update={"device": str(board.lidar_devices[lidar.name])})
                for lidar in settings.lidar
            ]
        )
        plugged = settings.model_copy(update={"link": link, "lidar": lidars})
        depth_spawn = None
        if settings.depth_camera:
            from chefbotd.components.simulation.process.simulated_depth import spawn_with

            depth_spawn = spawn_with(board.share_truth(), settings.sim)
        daemon = build(
            plugged,
            clock=clock,
            simulated=True,
            spawn_worker=_spawn_worker(settings),
            depth_spawn=depth_spawn,
            start_writer=_start_writer(settings),
            config_file=config_file,
        )
        await _serve(
            daemon,
            settings,
            as_service,
            clock,
            lambda: board.run(partial(daemon.entries.observe, daemon.bus)),
        )


def _spawn_worker(settings: Settings) -> WorkerSpawn | None:
    """Starts a worker on the clock that the robot shares; None: one on the computer's."""
    if settings.sim.shared_clock is None:
        return None
    from chefbotd.components.worker.spawn import spawn

    return partial(spawn, shared_clock=settings.sim.shared_clock)


def _start_writer(settings: Settings) -> StartWriter | None:
    """The thread that records; None where the extra ``recording`` is not installed."""
    from chefbotd.components.recording.parameters import RecordingParameters

    parameters = settings.of("recording", RecordingParameters)
    if not parameters.enabled:
        return None
    if not (find_spec("mcap") and find_spec(LIBRARIES[parameters.compression])):
        log.info(f"nothing is recorded, because the extra is missing: {how_to_add_extra('recording')}")
        return None
    from chefbotd.components.recording.writer import WriterThread

    return WriterThread


def freeze_gc() -> None:
    """Exclude what has been built from garbage collection, as it lives as long as the process.

    A full collection would stop the control loop for as long as it takes to look at every module, class and service.
    """
    gc.freeze()
