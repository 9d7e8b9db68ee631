"""The process around the daemon: its loop, its signals, its exit code, and a simulated robot where one is asked for."""

import asyncio
import gc
import os
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Optional, TypeAlias

import structlog
import uvloop

from chefbotd.app import Daemon, Loop
from chefbotd.clock import Clock, SystemClock
from chefbotd.component import Hardware, resolve
from chefbotd.link.board_memory import BoardFile
from chefbotd.process import keep_alive, signals
from chefbotd.process.build import build
from chefbotd.process.exit_deadline import ExitDeadline
from chefbotd.process.stop_guard import stop_guard
from chefbotd.process.watchdog import Watchdog, log_priority, raise_priority
from chefbotd.rpc.access import AccessError
from chefbotd.safety.latch import LatchParameters
from chefbotd.settings import Settings
from chefbotd.storage import state_folder
from chefbotd.transport.tcp import CannotListen, raise_descriptor_limit, require_descriptors

if TYPE_CHECKING:
    from chefbotd.process.service import DaemonService, Load

log = structlog.get_logger(component="app")

AsService = Callable[[Daemon], Optional["DaemonService"]]
ClockAndLoop: TypeAlias = tuple[Clock, Callable[[], asyncio.AbstractEventLoop]]


def run(
    settings: Settings,
    *,
    hardware: Hardware | None = None,
    load: "Load | None" = None,
    config_file: Path | None = None,
) -> int:
    """Run the daemon until a signal ends it; returns the exit code. ``load`` reads the configuration again, on SIGHUP.

    It drives ``hardware``; None: the robot's own board. ``config_file`` is the one that it was read from, None: the
    packaged one, which calibration does not write to.

    0, 1 after a failure, or 78 when the socket cannot be guarded as configured, or has too few descriptors.
    """
    clock, new_loop = _clock_of(settings, hardware)
    try:
        raise_descriptor_limit()
        require_descriptors(settings.api.reserved_stop_connections)
        with asyncio.Runner(loop_factory=new_loop) as runner:
            runner.run(_until_signalled(settings, load, config_file, clock, hardware))
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


def _clock_of(settings: Settings, hardware: Hardware | None) -> ClockAndLoop:
    """The clock, and how to make its loop; simulated hardware may bring its own."""
    if hardware is None:
        return SystemClock(), uvloop.new_event_loop
    made: ClockAndLoop = resolve(hardware.clock)(settings)
    return made


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
    settings: Settings,
    load: "Load | None",
    config_file: Path | None,
    clock: Clock,
    hardware: Hardware | None,
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
        serve = _serve_real if hardware is None else partial(_serve_simulated, hardware)
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
    daemon = build(settings, clock=clock, config_file=config_file, own_process=True, board_memory=memory)
    if folder is None:
        log.info(
            "a restart forgets an e-stop or a fault: neither [latch] folder nor RuntimeDirectory= is set"
        )
    async with stop_guard(settings):
        await _serve(daemon, settings, as_service, clock)


async def _serve_simulated(
    hardware: Hardware, settings: Settings, as_service: AsService, config_file: Path | None, clock: Clock
) -> None:
    """On simulated hardware, whose modules are not in the memory of a daemon on a real robot."""
    with resolve(hardware.connect)(settings, clock) as connected:
        daemon = build(
            connected.settings,
            clock=clock,
            simulated=True,
            substitutes=connected.substitutes,
            config_file=config_file,
            own_process=True,
        )
        await _serve(
            daemon,
            settings,
            as_service,
            clock,
            lambda: connected.run(partial(daemon.entries.observe, daemon.bus)),
        )


def freeze_gc() -> None:
    """Exclude what has been built from garbage collection, as it lives as long as the process.

    A full collection would stop the control loop for as long as it takes to look at every module, class and service.
    """
    gc.freeze()
