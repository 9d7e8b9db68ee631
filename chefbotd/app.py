"""The composition root: build every part, wire them, run them in one task group, stop the motors on the way out."""

import asyncio
import os
import random
from collections.abc import Awaitable, Callable, Coroutine, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import structlog

from chefbotd.bus import Bus, OnError
from chefbotd.clock import Clock
from chefbotd.core.events.inputs import BOARD_LINK, DaemonStarted, DaemonStopping, ServiceFailed
from chefbotd.entries import entries_of
from chefbotd.features.board.feature import board
from chefbotd.features.description.feature import description
from chefbotd.features.driving.feature import driving
from chefbotd.features.driving.motor_watch import MotorWatch
from chefbotd.features.driving.quadrature import QuadratureService
from chefbotd.features.driving.safety_keeper import SafetyKeeper, Scans
from chefbotd.features.driving.service import DriveService
from chefbotd.features.driving.wheel_reader import WheelReader
from chefbotd.features.feature import Feature, Service, methods_and_topics
from chefbotd.features.odometry.feature import odometry
from chefbotd.features.odometry.service import OdometryService
from chefbotd.features.sensors.feature import sensors
from chefbotd.features.sensors.service import SensorService
from chefbotd.features.simulation.feature import SIMULATION
from chefbotd.features.statistics.feature import statistics
from chefbotd.features.statistics.service import StatsService
from chefbotd.features.tuning.feature import tuning
from chefbotd.features.tuning.tuning import Tuning
from chefbotd.link.entry_session import EntrySession
from chefbotd.link.port import open_port
from chefbotd.link.reconnect import Opener, PortLink
from chefbotd.link.ring import FaultLog
from chefbotd.link.session import BoardSession
from chefbotd.maps.parameters import MapsParameters, folder_of
from chefbotd.metrics import Metrics
from chefbotd.motion.drive import Drive
from chefbotd.motion.limit_preview import LimitPreview
from chefbotd.rpc.access import Guard, load_guard
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.server import RpcServer
from chefbotd.safety.faults import Fault
from chefbotd.safety.latch import GateStore
from chefbotd.settings import Settings
from chefbotd.settings.urdf import urdf_of
from chefbotd.transport.tcp.server import TcpServer
from firmware_protocol.codec import VARIANTS

if TYPE_CHECKING:
    from pathlib import Path

    from chefbotd.recording.intake import Intake
    from chefbotd.recording.recorder import Recorder
    from chefbotd.recording.writer import Writer
    from chefbotd.transport.web.server import PageServer
    from chefbotd.worker.process import Worker
    from chefbotd.worker.skills.navigation_messages import NavigationSkillParameters
    from chefbotd.worker.spawn import Spawn

log = structlog.get_logger(component="app")


Loop = Callable[[], Coroutine[Any, Any, None]]
FeatureBuilder = Callable[[Bus, Clock], Feature]
NAVIGATION = "navigation"
"""The source of commands that navigation drives as; a robot without it does not navigate."""

DepthSpawn = Callable[[Any], Awaitable[Any]]
"""``link.depth.process.Spawn``, which is not loaded by a robot without a depth camera."""

StartWriter = Callable[["Intake", "Callable[[], Recorder]", int], "Writer"]
"""Starts what writes recordings: ``recording.writer.WriterThread``, or something else in tests."""


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
    ``features`` makes further ones, beside those that every robot has. ``spawn_worker`` starts the worker of a robot
    with a lidar, ``depth_spawn`` the process of a depth camera: None starts the real one. ``start_writer`` starts the
    thread that records; without it nothing is recorded.
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
        features: Sequence[FeatureBuilder] = (),
        spawn_worker: "Spawn | None" = None,
        depth_spawn: DepthSpawn | None = None,
        start_writer: StartWriter | None = None,
    ) -> None:
        self.bus = Bus()
        self.entries = self._clock = clock = entries_of(clock)
        self.entries.bus = self.bus
        variant = VARIANTS[settings.robot.wire]
        self.session = BoardSession(
            self.bus,
            clock,
            variant,
            device=settings.link.device,
            setpoints_per_s=settings.link.setpoints_per_s,
            health_after_s=settings.link.health_after_s,
            board_buffer_bytes=settings.link.board_buffer_bytes,
        )
        self._fault_log = FaultLog(self.bus, self.session.lines)
        rng = rng or random.Random()
        self._link = PortLink(
            settings.link, EntrySession(BOARD_LINK, self.session, clock), opener, clock, rng
        )
        self._latch, self._supervisor = latch, supervisor
        self.driving = _drive_service(settings, self.bus, clock, self.session, latch)
        self.limit_preview = LimitPreview(settings.drive, settings.chassis, settings.limits)
        session = os.urandom(4).hex()
        let_go_s = settings.safety.held_until_silent_s
        self.worker: Worker | None = None
        self.leases = ControlLeases(settings.api.lease_s, let_go_s, self.driving.release, self.bus.publish)
        self.metrics = Metrics()
        built = _recording(settings, self.bus, clock, start_writer, session, simulated=simulated)
        built += _foxglove(settings, self.bus, clock)
        built += [feature(self.bus, clock) for feature in features]
        built += _lidars(settings, self.bus, clock, opener, rng)
        built += self._map_features(settings, spawn_worker, simulated=simulated)
        built += _depth_cameras(settings, self.bus, clock, rng, depth_spawn)
        self.features = [*built, *self._own_features(settings, simulated=simulated)]
        methods, topics = methods_and_topics(self.features)
        guard = load_guard(settings.api, os.environ)
        self.rpc = RpcServer(
            methods,
            topics,
            self.bus,
            clock,
            settings.api,
            self.leases,
            robot_name=settings.robot.name,
            session=session,
            sources=tuple(settings.safety.sources),
            default_source=settings.safety.default_source,
            command_timeout_s=settings.safety.command_timeout_s,
            resume=self.driving.resume,
            link_is_up=lambda: self.session.is_open,
            keyring=guard.keyring,
        )
        self.server = TcpServer(self.rpc, settings.api, guard.tls)
        self.page = _page(settings, self.rpc, guard, self.metrics)
        self.features += _discovery(settings, self.server, self.page)
        self._add_metrics()

    def _own_features(self, settings: Settings, *, simulated: bool) -> list[Feature]:
        """Every feature of the robot; the link comes last, so that all the others run before the board is touched."""
        bus, clock, driven = self.bus, self._clock, settings.drive.max_duty
        names = tuple(wheel.name for wheel in settings.chassis.wheels)
        gains = Tuning(self.driving, driven, driven * settings.safety.wheels.driven_duty_share)
        return [
            driving(
                self.driving,
                QuadratureService(bus, settings.quadrature, names),
                self.limit_preview,
                self.leases,
                clock,
                wheel_names=names,
                sources=tuple(settings.safety.sources),
                default_source=settings.safety.default_source,
                arm_role=settings.api.arm_role,
            ),
            odometry(OdometryService(bus, clock, settings.chassis, settings.odometry)),
            tuning(gains),
            sensors(
                SensorService(
                    bus,
                    ultrasonic_parameters=settings.ultrasonic,
                    infrared_parameters=settings.infrared,
                    imu_parameters=settings.imu,
                    battery_parameters=settings.battery,
                )
            ),
            statistics(StatsService(bus, clock, self.metrics), self.metrics, clock),
            description(_description(settings)),
            *([SIMULATION] if simulated else []),
            board(self.session, self._link, self._fault_log, self.driving.brake),
        ]

    def _map_features(
        self, settings: Settings, spawn_worker: "Spawn | None", *, simulated: bool
    ) -> list[Feature]:
        """Stored maps, where they are configured or made; the worker and mapping, where there is a lidar."""
        makes_maps = bool(settings.lidar) and settings.worker.enabled
        if settings.maps is None and not makes_maps:
            return []
        from chefbotd.features.maps.feature import maps  # only a robot with maps loads them
        from chefbotd.features.maps.service import MapsService
        from chefbotd.maps.store import MapStore

        parameters = settings.maps or MapsParameters()
        folder, kept = folder_of(parameters, os.environ, simulated=simulated), parameters.versions_kept
        stored = MapsService(self.bus, self._clock, MapStore(folder, kept), kept)
        if not makes_maps:
            return [maps(stored)]
        from chefbotd.features.driving.inner_driver import InnerDriver
        from chefbotd.features.localization.feature import localization
        from chefbotd.features.localization.service import LocalizationService
        from chefbotd.features.mapping.feature import mapping  # only a robot with a lidar loads numpy
        from chefbotd.features.mapping.service import MappingService
        from chefbotd.features.navigation.feature import navigation
        from chefbotd.features.navigation.service import NavigationService
        from chefbotd.features.worker.feature import worker
        from chefbotd.features.worker.service import WorkerService
        from chefbotd.worker.skills import localization_messages, navigation_messages
        from chefbotd.worker.skills.mapping_messages import SKILL, MappingSkillParameters

        skill = MappingSkillParameters(
            lidar=settings.mapping.lidar or settings.lidar[0].name,
            folder=folder,
            versions_kept=kept,
            session=os.urandom(8).hex(),
            mapping=settings.mapping,
        )
        located = localization_messages.LocalizationSkillParameters(
            lidar=settings.localization.lidar or settings.lidar[0].name,
            folder=folder,
            pose_file=folder / localization_messages.POSE_FILE,
            search_by_itself=settings.localization.search_by_itself,
            save_every_s=settings.localization.save_every_s,
        )
        navigated = _navigation_skill(settings, folder)
        skills = {
            SKILL: skill.model_dump_json().encode(),
            localization_messages.SKILL: located.model_dump_json().encode(),
            navigation_messages.SKILL: navigated.model_dump_json().encode(),
        }
        mounts = settings.range_mounts()
        feed = WorkerService(self.bus, self._clock, settings.worker, skills, spawn_worker, mounts)
        self.worker = feed.worker
        finder = LocalizationService(self.bus, self._clock, feed)
        made = MappingService(self.bus, self._clock, feed, stored.use_saved)
        stored.growing = made.grid
        features = [maps(stored), worker(feed), mapping(made), localization(finder)]
        if NAVIGATION not in settings.safety.sources:
            return features
        driver = InnerDriver(self.driving, self.leases, self._clock, NAVIGATION)
        goes = NavigationService(self.bus, self._clock, feed, driver, stored, settings.navigation)
        return [*features, navigation(goes)]

    def _add_metrics(self) -> None:
        """Add what the process itself counts, and have every part add its own."""
        metrics = self.metrics
        metrics.counters(
            "bus_dropped", "Events that a full inbox gave up.", "event", lambda: self.bus.drops()
        )
        metrics.counters(
            "service_failures",
            "Services that were started again.",
            "service",
            lambda: self._supervisor.failures,
        )
        self.rpc.add_metrics(metrics)
        for feature in self.features:
            feature.add_metrics(metrics)

    async def run(self, *more: Loop) -> None:
        """Run every part, and ``more`` beside them, until cancelled or until one of them fails.

        The socket listens before the board is touched. However this ends, the motors are told to stop before all else.
        To be cancelled is to end in order; after any other end the next daemon begins disarmed, where a latch is kept.
        """
        with self.entries.entry(self._started):
            pass
        try:
            await self._run(*more)
        except asyncio.CancelledError:
            self._latch.end()
            raise

    def _started(self, stamp_s: float) -> DaemonStarted:
        gate = self.driving.gate
        return DaemonStarted(
            stamp_s, str(gate.mode), gate.reason, None if gate.fault is None else str(gate.fault)
        )

    def _fail(self, fault: Fault) -> None:
        with self.entries.entry(ServiceFailed, fault.reason):
            self.driving.fail(fault)

    def _loop_of(self, service: Service) -> Loop:
        """What runs the service: where a replay runs it again, in steps."""
        if not service.in_steps:
            return service.run
        return partial(self.entries.in_steps, service.name, service.run)

    async def _run(self, *more: Loop) -> None:
        run_restarting = partial(self._supervisor.run_restarting, on_failure=self._fail)
        run_critical = self._supervisor.run_critical
        async with asyncio.TaskGroup() as group:
            try:
                group.create_task(run_critical("rpc", self.rpc.run))
                group.create_task(run_critical("server", self.server.run))
                await self.server.address()
                if self.page is not None:
                    group.create_task(run_critical("page", self.page.run))
                    await self.page.address()
                for loop in more:
                    group.create_task(loop())
                for service in [each for feature in self.features for each in feature.services]:
                    run = run_critical if service.critical else run_restarting
                    group.create_task(run(service.name, self._loop_of(service)))
                await asyncio.Event().wait()
            finally:
                try:
                    if self.entries.recording:
                        self.bus.publish(DaemonStopping(self.entries.now_s()))
                finally:
                    self.driving.detach()
                    self.session.close()


def _page(settings: Settings, rpc: RpcServer, guard: Guard, metrics: Metrics) -> "PageServer | None":
    """Loaded only where it is served."""
    if not settings.page.enabled:
        return None
    parameters = settings.page
    if settings.discovery.enabled:
        own = f"{settings.discovery.label(settings.robot.name)}.local".lower()
        parameters = parameters.model_copy(update={"allowed_hosts": (*parameters.allowed_hosts, own)})
    from chefbotd.transport.web.server import PageServer

    return PageServer(rpc, parameters, guard, metrics)


def _foxglove(settings: Settings, bus: Bus, clock: Clock) -> list[Feature]:
    """Loaded only where it is served."""
    if not settings.foxglove.enabled:
        return []
    from chefbotd.features.foxglove.feature import foxglove

    return [foxglove(bus, clock, settings.foxglove, settings.robot.name, _first_scanner(settings))]


def _first_scanner(settings: Settings) -> str | None:
    """Whose scans are drawn as the robot's."""
    scanners = [lidar.name for lidar in settings.lidar] + [each.name for each in settings.depth_camera]
    return scanners[0] if scanners else None


def _recording(
    settings: Settings,
    bus: Bus,
    clock: Clock,
    start_writer: StartWriter | None,
    session: str,
    *,
    simulated: bool,
) -> list[Feature]:
    """Loaded only where it is recorded; the libraries that write files, in the thread that writes."""
    if start_writer is None or not settings.recording.enabled:
        return []
    from chefbotd.features.recording.feature import recording
    from chefbotd.features.recording.making import Made, intake_of, recorder_maker
    from chefbotd.features.recording.service import RecordingService
    from chefbotd.recording.parameters import folder_of

    parameters = settings.recording
    folder = folder_of(parameters, os.environ, simulated=simulated)
    made = Made(
        settings.robot.name,
        session,
        lambda: settings.model_dump_json(by_alias=True),
        lambda: _description(settings),
        _first_scanner(settings),
    )
    intake = intake_of(parameters, made, clock.now_s())
    make = recorder_maker(parameters, folder, made, intake)
    writer = start_writer(intake, make, round(parameters.queue_mb * 1e6))
    return [recording(RecordingService(bus, clock, parameters, folder, writer))]


def _discovery(settings: Settings, server: TcpServer, page: "PageServer | None") -> list[Feature]:
    """Loaded only where the robot is to be found."""
    if not settings.discovery.enabled:
        return []
    from chefbotd.features.discovery.feature import discovery

    where = None if page is None else page.address
    encrypted = settings.api.tls_certificate is not None
    return [discovery(settings.discovery, settings.robot.name, server.address, where, encrypted=encrypted)]


def _lidars(settings: Settings, bus: Bus, clock: Clock, opener: Opener, rng: random.Random) -> list[Feature]:
    """Loaded only where there is one: scans need numpy."""
    if not settings.lidar:
        return []
    from chefbotd.features.lidars.feature import lidars

    return [lidars(settings.lidar, bus, clock, opener, rng)]


def _navigation_skill(settings: Settings, folder: "Path") -> "NavigationSkillParameters":
    """The robot's outline, and how fast it may be: a wheel needs a tenth more than its share, to correct."""
    from chefbotd.features.driving.scan_watch import outline_of
    from chefbotd.safety.outline import Box
    from chefbotd.worker.skills.navigation_messages import NavigationSkillParameters

    outline = outline_of(settings.chassis, settings.body_size_m, settings.sim.body.wheelbase_m)
    is_box = isinstance(outline, Box)
    return NavigationSkillParameters(
        folder=folder,
        radius_m=None if is_box else outline.radius_m,
        half_length_m=outline.half_length_m if isinstance(outline, Box) else 0.0,
        half_width_m=outline.half_width_m if isinstance(outline, Box) else 0.0,
        max_speed_m_s=min(settings.navigation.max_speed_m_s, 0.9 * settings.drive.max_rim_speed_m_s),
    )


def _scan_guard(settings: Settings, bus: Bus, clock: Clock) -> Callable[[OnError], Scans] | None:
    """Loaded only where a lidar or a depth camera guards."""
    lidars, cameras = settings.lidar, settings.depth_camera
    if not any(lidar.guards for lidar in lidars) and not any(camera.guards for camera in cameras):
        return None
    from chefbotd.features.driving.scan_watch import ScanWatch, outline_of

    guard, chassis = settings.safety.guard, settings.chassis
    outline = outline_of(chassis, settings.body_size_m, settings.sim.body.wheelbase_m)
    near = [camera.name for camera in cameras]
    return lambda on_error: ScanWatch(
        bus, clock, guard, chassis, [*lidars, *cameras], outline, blind_near=near, on_error=on_error
    )


def _depth_cameras(
    settings: Settings, bus: Bus, clock: Clock, rng: random.Random, spawn: DepthSpawn | None
) -> list[Feature]:
    """Loaded only where there is one; where no lidar is, they bring the topic of the scans."""
    if not settings.depth_camera:
        return []
    from chefbotd.features.depth_cameras.feature import depth_cameras
    from chefbotd.features.lidars.feature import topics
    from chefbotd.link.depth.process import spawn_program

    scan = [] if settings.lidar else [topic for topic in topics(()) if topic.name == "scan"]
    return [depth_cameras(settings.depth_camera, bus, clock, rng, spawn or spawn_program, scan)]


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
        scans=_scan_guard(settings, bus, clock),
    )
    return DriveService(
        bus,
        clock,
        session.send_duty,
        drive,
        keeper,
        reader=WheelReader(settings.chassis, settings.encoders, settings.same_side),
        wheel_names=names,
        control=settings.control,
        duty_ceiling=session.duty_ceiling,
        patience_s=settings.watchdog.patience_s,
    )
