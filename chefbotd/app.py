"""The composition root: build every part, wire them, run them in one task group, stop the motors on the way out."""

import asyncio
import gc
import os
import random
import secrets
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import structlog
import uvloop

from chefbotd import signals, systemd
from chefbotd.api.access import AccessError, load_guard
from chefbotd.api.doorway import CannotListen
from chefbotd.api.server import Server
from chefbotd.bus import Bus
from chefbotd.clock import Clock, SystemClock
from chefbotd.core.events import StatsSampled
from chefbotd.link.port import open_port
from chefbotd.link.reconnect import BoardLink, Opener
from chefbotd.link.ring import FaultLog
from chefbotd.link.session import BoardSession
from chefbotd.motion.allowance import Allowance
from chefbotd.motion.drive import Drive
from chefbotd.robot import WiredRobot
from chefbotd.services.drive import DriveService
from chefbotd.services.odometry import OdometryService
from chefbotd.services.quadrature import QuadratureService
from chefbotd.services.safety import SafetyKeeper
from chefbotd.services.sensors import SensorService
from chefbotd.services.stats import StatsService
from chefbotd.services.supervisor import Supervisor
from chefbotd.services.tuning import Tuning
from chefbotd.services.watchdog import Watchdog
from chefbotd.services.wheel_reader import WheelReader
from chefbotd.settings import Settings
from chefbotd.simulation import simulation_of
from firmware_protocol.codec import VARIANTS

log = structlog.get_logger(component="app")


Loop = Callable[[], Coroutine[Any, Any, None]]


class Daemon:
    """One robot, ready to run: on its serial port, or through whatever ``opener`` opens."""

    def __init__(
        self,
        settings: Settings,
        *,
        clock: Clock,
        opener: Opener = open_port,
        simulated: bool = False,
        rng: random.Random | None = None,
    ) -> None:
        self.bus = Bus()
        self._clock, self._started_s = clock, clock.now_s()
        variant = VARIANTS[settings.robot.wire]
        names = tuple(wheel.name for wheel in settings.chassis.wheels)
        self.session = BoardSession(
            self.bus,
            clock,
            variant,
            device=settings.link.device,
            setpoints_per_s=settings.link.setpoints_per_s,
            judged_after_s=settings.link.judged_after_s,
        )
        self._fault_log = FaultLog(self.bus, self.session.lines)
        self._link = BoardLink(settings.link, self.session, opener, clock, rng or random.Random())
        self.driving = _drive_service(settings, self.bus, clock, self.session.send_duty)
        self._odometry = OdometryService(self.bus, clock, settings.chassis, settings.odometry)
        self._quadrature = QuadratureService(self.bus, settings.quadrature, names)
        self._sensors = SensorService(
            self.bus,
            ultrasonic_parameters=settings.ultrasonic,
            infrared_parameters=settings.infrared,
            imu_parameters=settings.imu,
            battery_parameters=settings.battery,
        )
        self._stats = StatsService(self.bus, clock, self._collect_stats)
        self._supervisor = Supervisor(clock, self.driving.fail)
        self.watchdog = Watchdog(
            settings.watchdog,
            clock,
            self.driving,
            self.session.stop_from_thread,
            self.driving.report_from_thread,
        )
        self.server = Server(
            WiredRobot(
                self.driving,
                self._odometry,
                self.session,
                self._stats,
                Tuning(self.driving, settings.drive.max_duty),
                settings.safety.default_source,
                _description(settings.robot.description),
                tuple(settings.safety.sources),
                Allowance(settings.drive, settings.chassis, settings.limits),
            ),
            self.bus,
            clock,
            settings.api,
            robot_name=settings.robot.name,
            session=secrets.token_hex(4),
            wheel_names=names,
            simulated=simulated,
            guard=load_guard(settings.api, os.environ),
        )

    async def run(self, *more: Loop) -> None:
        """Run every part, and ``more`` beside them, until cancelled or until one of them fails.

        The socket listens before the board is touched. However this ends, the motors are told to stop before all else.
        """
        kept, insist = self._supervisor.keep, self._supervisor.insist
        async with asyncio.TaskGroup() as group:
            try:
                group.create_task(insist("server", self.server.run))
                await self.server.address()
                group.create_task(insist("drive", self.driving.run))
                group.create_task(insist("quadrature", self._quadrature.run))
                group.create_task(kept("odometry", self._odometry.run))
                group.create_task(kept("sensors", self._sensors.run))
                group.create_task(kept("stats", self._stats.run))
                group.create_task(kept("fault log", self._fault_log.run))
                for loop in more:
                    group.create_task(loop())
                group.create_task(insist("link", self._link.run))
                await asyncio.Event().wait()
            finally:
                self.session.close()

    def _collect_stats(self, stamp_s: float, loop_lag_s: float) -> StatsSampled:
        session, clock, driving = self.session, self.session.board_clock, self.driving
        return StatsSampled(
            stamp_s=stamp_s,
            uptime_s=stamp_s - self._started_s,
            frames=session.frames,
            refused=session.refused,
            lines_out=session.lines_out,
            setpoints_replaced=session.setpoints_replaced,
            link_opens=session.opens,
            board_restarts=session.board_restarts,
            encoder_readings_refused=driving.readings_refused,
            control_steps=driving.steps,
            bus_dropped=self.bus.drops(),
            clients=self.server.clients,
            clients_refused=dict(self.server.refused),
            handler_faults=dict(self.server.faults),
            internal_errors=driving.internal_errors,
            service_failures=dict(self._supervisor.failures),
            telemetry_dropped=self.server.drops.total(),
            loop_lag_s=loop_lag_s,
            board_clock_skew_ppm=clock.relation.skew_ppm,
            board_clock_jitter_s=clock.relation.jitter_s,
            board_clock_suspects=clock.suspects,
            encoder_transitions_illegal=self._quadrature.illegal_transitions,
            encoder_levels_repeated=self._quadrature.repeated_levels,
            encoder_edges_lost=self._quadrature.lost_edges,
            bytes_in=session.hearing.bytes_in,
        )


def _description(path: Path | None) -> str | None:
    """The robot's URDF; one that cannot be read keeps nobody from driving."""
    if path is None:
        return None
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        log.warning("the robot's description cannot be read", path=str(path), error=str(error))
        return None


def _drive_service(
    settings: Settings, bus: Bus, clock: Clock, send_duty: Callable[[tuple[int, ...]], None]
) -> DriveService:
    names = tuple(wheel.name for wheel in settings.chassis.wheels)
    drive = Drive(settings.drive, settings.chassis, settings.limits, tuple(settings.gains().values()))
    keeper = SafetyKeeper(
        bus,
        clock,
        settings.safety,
        wheel_names=names,
        counts_per_turn=settings.encoders.counts_per_turn,
        mounts=settings.range_mounts(),
    )
    return DriveService(
        bus,
        clock,
        send_duty,
        drive,
        keeper,
        reader=WheelReader(settings.chassis, settings.encoders, settings.mates),
        wheel_names=names,
        control=settings.control,
    )


def run(settings: Settings, *, simulated: bool) -> int:
    """Run the daemon until a signal ends it; returns the exit code.

    0, 1 after a failure, or 78 when the socket cannot be guarded as configured.
    """
    try:
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(_until_signalled(settings, simulated=simulated))
    except BaseExceptionGroup as failures:
        for failure in _leaves(failures):
            if isinstance(failure, CannotListen):
                log.error("cannot serve", error=str(failure))
            else:
                log.error("cannot go on", error=repr(failure), exc_info=failure)
        return 1
    except AccessError as problem:
        log.error("cannot serve", error=str(problem))
        return os.EX_CONFIG
    return 0


def _leaves(group: BaseExceptionGroup[BaseException]) -> Iterator[BaseException]:
    for error in group.exceptions:
        if isinstance(error, BaseExceptionGroup):
            yield from _leaves(error)
        else:
            yield error


async def _until_signalled(settings: Settings, *, simulated: bool) -> None:
    task = asyncio.current_task()
    assert task is not None  # noqa: S101 - a coroutine that runs has a task
    received: list[str] = []

    def end(name: str) -> None:
        received.append(name)
        task.cancel()

    signals.handle(end)
    try:
        await (_serve_simulated(settings) if simulated else _serve(Daemon(settings, clock=SystemClock())))
    except asyncio.CancelledError:
        if not received:
            raise
    finally:
        systemd.notify("STOPPING=1")
    log.info("stopped", signal=received[0])


async def _serve(daemon: Daemon, *more: Loop) -> None:
    async def report_ready() -> None:
        host, port = await daemon.server.address()
        settle()
        systemd.notify(f"READY=1\nSTATUS=listening on {host}:{port}")

    with daemon.watchdog:
        await daemon.run(report_ready, *more)


def settle() -> None:
    """Let the garbage collector pass over what has been built: it lives as long as the process does.

    A full collection would stop the control loop for as long as it takes to look at every module, class and service.
    """
    gc.collect()
    gc.freeze()


async def _serve_simulated(settings: Settings) -> None:
    # Imported here: what simulates a robot has no place in the memory of a daemon on a real one.
    from chefbotd.sim.embedded import EmbeddedBoard

    with EmbeddedBoard(simulation_of(settings), SystemClock()) as board:
        link = settings.link.model_copy(update={"device": str(board.device)})
        daemon = Daemon(settings.model_copy(update={"link": link}), clock=SystemClock(), simulated=True)
        await _serve(daemon, lambda: board.run(daemon.bus.publish))
