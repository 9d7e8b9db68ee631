"""The composition root: build every part, wire them, run them in one task group, stop the motors on the way out."""

import asyncio
import os
import random
import secrets
from collections.abc import Callable, Coroutine, Mapping
from functools import partial
from typing import Any, Protocol

import structlog

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.events import StatsSampled
from chefbotd.features.driving.motor_watch import MotorWatch
from chefbotd.features.driving.quadrature import QuadratureService
from chefbotd.features.driving.safety_keeper import SafetyKeeper
from chefbotd.features.driving.service import DriveService
from chefbotd.features.driving.wheel_reader import WheelReader
from chefbotd.features.odometry.service import OdometryService
from chefbotd.features.sensors.service import SensorService
from chefbotd.features.statistics.service import StatsService
from chefbotd.features.tuning.tuning import Tuning
from chefbotd.link.port import open_port
from chefbotd.link.reconnect import BoardLink, Opener
from chefbotd.link.ring import FaultLog
from chefbotd.link.session import BoardSession
from chefbotd.motion.drive import Drive
from chefbotd.motion.limit_preview import LimitPreview
from chefbotd.robot import WiredRobot
from chefbotd.rpc.access import load_guard
from chefbotd.rpc.server import RpcServer
from chefbotd.safety.faults import Fault
from chefbotd.safety.latch import GateStore
from chefbotd.settings import Settings
from chefbotd.settings.urdf import urdf_of
from chefbotd.transport.tcp.server import TcpServer
from firmware_protocol.codec import VARIANTS

log = structlog.get_logger(component="app")


Loop = Callable[[], Coroutine[Any, Any, None]]


class Supervisor(Protocol):
    """Runs services until they are cancelled; ``failures`` counts by the service's name."""

    @property
    def failures(self) -> Mapping[str, int]:
        """How often each service has failed."""
        ...

    async def run_restarting(self, name: str, loop: Loop, on_failure: Callable[[Fault], None]) -> None:
        """Run a service, and start it again after it has failed and ``on_failure`` has been called."""
        ...

    async def run_critical(self, name: str, loop: Loop) -> None:
        """Run a service that the robot cannot do without: its end is an error."""
        ...


class Daemon:
    """One robot, ready to run: on its serial port, or through whatever ``opener`` opens.

    ``latch`` keeps the gate's state beyond the end of the process, ``supervisor`` runs the services.
    """

    def __init__(
        self,
        settings: Settings,
        *,
        clock: Clock,
        latch: GateStore,
        supervisor: Supervisor,
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
            board_buffer_bytes=settings.link.board_buffer_bytes,
        )
        self._fault_log = FaultLog(self.bus, self.session.lines)
        self._link = BoardLink(settings.link, self.session, opener, clock, rng or random.Random())
        self._latch, self._supervisor = latch, supervisor
        self.driving = _drive_service(settings, self.bus, clock, self.session, latch)
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
        guard = load_guard(settings.api, os.environ)
        self.rpc = RpcServer(
            WiredRobot(
                self.driving,
                self._odometry,
                self.session,
                self._stats,
                Tuning(
                    self.driving,
                    settings.drive.max_duty,
                    settings.drive.max_duty * settings.safety.wheels.driven_duty_share,
                ),
                settings.safety.command_timeout_s,
                settings.safety.default_source,
                _description(settings),
                tuple(settings.safety.sources),
                LimitPreview(settings.drive, settings.chassis, settings.limits),
                settings.safety.held_until_silent_s,
            ),
            self.bus,
            clock,
            settings.api,
            robot_name=settings.robot.name,
            session=secrets.token_hex(4),
            wheel_names=names,
            simulated=simulated,
            keyring=guard.keyring,
        )
        self.server = TcpServer(self.rpc, settings.api, guard.tls)

    async def run(self, *more: Loop) -> None:
        """Run every part, and ``more`` beside them, until cancelled or until one of them fails.

        The socket listens before the board is touched. However this ends, the motors are told to stop before all else.
        To be cancelled is to end in order; after any other end the next daemon begins disarmed, where a latch is kept.
        """
        try:
            await self._run(*more)
        except asyncio.CancelledError:
            self._latch.end()
            raise

    async def _run(self, *more: Loop) -> None:
        run_restarting = partial(self._supervisor.run_restarting, on_failure=self.driving.fail)
        run_critical = self._supervisor.run_critical
        async with asyncio.TaskGroup() as group:
            try:
                group.create_task(run_critical("rpc", self.rpc.run))
                group.create_task(run_critical("server", self.server.run))
                await self.server.address()
                group.create_task(run_critical("drive", self.driving.run))
                group.create_task(run_critical("quadrature", self._quadrature.run))
                group.create_task(run_restarting("odometry", self._odometry.run))
                group.create_task(run_restarting("sensors", self._sensors.run))
                group.create_task(run_restarting("stats", self._stats.run))
                group.create_task(run_restarting("fault log", self._fault_log.run))
                for loop in more:
                    group.create_task(loop())
                group.create_task(run_critical("link", self._link.run))
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
            clients=self.rpc.clients,
            clients_refused=dict(self.rpc.refused),
            handler_faults=dict(self.rpc.faults),
            void_commands=dict(self.rpc.void_commands),
            internal_errors=driving.internal_errors,
            service_failures=dict(self._supervisor.failures),
            telemetry_dropped=self.rpc.drops.total(),
            loop_lag_s=loop_lag_s,
            board_clock_skew_ppm=clock.relation.skew_ppm,
            board_clock_jitter_s=clock.relation.jitter_s,
            board_clock_suspects=clock.suspects,
            encoder_transitions_illegal=self._quadrature.illegal_transitions,
            encoder_levels_repeated=self._quadrature.repeated_levels,
            encoder_edges_lost=self._quadrature.lost_edges,
            bytes_in=session.hearing.bytes_in,
        )


def _description(settings: Settings) -> str | None:
    """The robot's URDF; one of its own that cannot be read keeps nobody from driving."""
    path = settings.robot.description
    if path is None:
        return urdf_of(settings)
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        log.warning("the robot's description cannot be read", path=str(path), error=str(error))
        return None


def _drive_service(
    settings: Settings,
    bus: Bus,
    clock: Clock,
    session: BoardSession,
    latch: GateStore,
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
        latch=latch,
        motors=MotorWatch(settings.safety, settings.chassis),
    )
    return DriveService(
        bus,
        clock,
        session.send_duty,
        drive,
        keeper,
        reader=WheelReader(settings.chassis, settings.encoders, settings.mates),
        wheel_names=names,
        control=settings.control,
        duty_ceiling=lambda: session.duty_ceiling,
    )
