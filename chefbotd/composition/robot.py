"""Builds what every robot has: the session with its board, the control loop, and the basic features."""

from collections.abc import Callable, Mapping
from functools import cache, partial

import structlog

from chefbotd.composition.context import DaemonContext
from chefbotd.composition.scanners import scan_guard
from chefbotd.driving.commands import driving
from chefbotd.driving.description.service import description
from chefbotd.driving.motor_watch import MotorWatch
from chefbotd.driving.odometry.service import OdometryService, odometry
from chefbotd.driving.quadrature import QuadratureService
from chefbotd.driving.safety_supervisor import SafetySupervisor
from chefbotd.driving.sensors.service import SensorService, sensors
from chefbotd.driving.service import DriveService
from chefbotd.driving.wheel_controller import WheelController
from chefbotd.driving.wheel_reader import WheelReader
from chefbotd.features.feature import Feature
from chefbotd.link.board_memory import BoardMemory
from chefbotd.link.counting import Counting
from chefbotd.link.port import FirmwareMode
from chefbotd.link.session import BoardSession
from chefbotd.link.wheel_loop import WheelLoop, WheelLoopParameters, wheel_loop_parameters
from chefbotd.link.wires import variant_of
from chefbotd.motion.drive import Drive
from chefbotd.motion.drive_state import LOADED_SHARE
from chefbotd.motion.encoder import CountedBy
from chefbotd.motion.limit_preview import LimitPreview
from chefbotd.motion.pid import PidParameters
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.safety.latch import GateStore
from chefbotd.settings import Settings
from chefbotd.settings.notes import guard_warning

log = structlog.get_logger(component="app")


def board_session(context: DaemonContext, memory: BoardMemory | None) -> BoardSession:
    """The session with the board, in the variant of the wire that it speaks."""
    settings = context.settings
    encoders = settings.encoders
    counting = Counting(encoders.counts_per_turn, encoders.counted_by is CountedBy.FIRMWARE)
    return BoardSession(
        context.bus,
        context.clock,
        variant_of(settings.robot.wire),
        device=settings.link.device,
        setpoints_per_s=settings.link.setpoints_per_s,
        health_after_s=settings.link.health_after_s,
        board_buffer_bytes=settings.link.board_buffer_bytes,
        negotiates=settings.link.firmware is FirmwareMode.AUTO,
        deadman_ms=settings.link.deadman_ms,
        counting=counting,
        memory=memory,
    )


def drive_service(context: DaemonContext, session: BoardSession, latch: GateStore) -> DriveService:
    """The control loop with what keeps it safe."""
    settings, bus, clock = context.settings, context.bus, context.clock
    drive = Drive(settings.drive, settings.chassis, settings.limits, tuple(settings.gains().values()))
    keeper = SafetySupervisor(
        bus,
        clock,
        settings.safety,
        mounts=settings.range_mounts(),
        latch=latch,
        session=int(context.session, 16),
        motors=MotorWatch(
            settings.safety,
            settings.chassis,
            settings.encoders.counts_per_turn,
            settings.drive.max_rim_speed_m_s / LOADED_SHARE,
        ),
        scans=scan_guard(context),
        guard_warning=guard_warning(settings),
    )
    service = DriveService(
        bus,
        clock,
        session.send_duty,
        drive,
        keeper,
        reader=WheelReader(settings.chassis, settings.encoders, settings.same_side),
        wheel_names=context.wheel_names,
        control=settings.control,
        duty_ceiling=session.duty_ceiling,
        repeat_duty=session.repeat_duty,
        watchdog=settings.watchdog,
    )
    if settings.link.wheel_loop:
        _use_wheel_loop(settings, service.wheels, session.firmware.loop)
    return service


def _use_wheel_loop(settings: Settings, wheels: WheelController, loop: WheelLoop) -> None:
    """Drive by the board's own loop, with the gains of the controllers here, also when they are changed."""

    def parameters(gains: Mapping[str, PidParameters]) -> WheelLoopParameters:
        counts_per_turn = settings.encoders.counts_per_turn
        return wheel_loop_parameters(settings.chassis, counts_per_turn, tuple(gains.values()))

    loop.use(
        parameters(wheels.gains()),
        lambda: None if wheels.drive_state.by_duty else wheels.targets_rad_s,
    )
    wheels.call_on_gains(lambda gains: loop.change(parameters(gains)))


def robot_features(
    context: DaemonContext, service: DriveService, preview: LimitPreview, leases: ControlLeases
) -> list[Feature]:
    """The features for driving, odometry, sensors and description."""
    settings, bus, clock = context.settings, context.bus, context.clock
    return [
        driving(
            service,
            QuadratureService(bus, settings.quadrature, context.wheel_names),
            preview,
            leases,
            clock,
            wheel_names=context.wheel_names,
            sources=settings.safety.offered,
            default_source=settings.safety.default_source,
            arm_role=settings.api.arm_role,
        ),
        odometry(OdometryService(bus, clock, settings.chassis, settings.odometry, settings.imu)),
        sensors(
            SensorService(
                bus,
                ultrasonic_parameters=settings.ultrasonic,
                infrared_parameters=settings.infrared,
                imu_parameters=settings.imu,
                battery_parameters=settings.battery,
            )
        ),
        description(robot_description(settings)),
    ]


def robot_description(settings: Settings) -> Callable[[], str | None]:
    """The function that returns the robot's URDF. A URDF file that cannot be read does not stop the robot."""
    path = settings.robot.description
    if path is None:
        return cache(partial(_made_description, settings))
    try:
        if path.exists() and not path.is_file():
            raise OSError(f"{path} is no regular file")  # a FIFO would wait for who writes it, for ever
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        log.warning("the robot's description cannot be read", path=str(path), error=str(error))
        return lambda: None
    return lambda: text


def _made_description(settings: Settings) -> str:
    from chefbotd.settings.urdf import urdf_of  # what writes XML is not loaded before somebody asks

    return urdf_of(settings)
