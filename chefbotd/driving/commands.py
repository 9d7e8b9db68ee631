"""The methods that move and stop the robot, and the feature for driving."""

from chefbotd.clock import Clock
from chefbotd.core.geometry import Twist2D
from chefbotd.core.record import replace
from chefbotd.core.sentence import Sentence
from chefbotd.driving.models import (
    ArmParams,
    Driven,
    DriveParams,
    EstopParams,
    SetWheelVelocitiesParams,
    StopParams,
    Stopped,
    WheelSpeedsSet,
    topics,
)
from chefbotd.driving.quadrature import QuadratureService
from chefbotd.driving.service import DriveService
from chefbotd.features.feature import Feature, Service
from chefbotd.metrics import Metrics
from chefbotd.motion.limit_preview import LimitPreview
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.method import Caller, Method, Unserved, method, methods_of
from chefbotd.rpc.models import DONE, Done
from chefbotd.rpc.parameters import Role


class DriveCommands:
    """The methods that move and stop the robot; their answers say what the limits allow.

    ``sources`` are the configured ones; a velocity command that names none is one of ``default_source``.
    """

    def __init__(
        self,
        service: DriveService,
        preview: LimitPreview,
        leases: ControlLeases,
        clock: Clock,
        *,
        sources: tuple[str, ...],
        default_source: str,
    ) -> None:
        self._service, self._preview, self._leases, self._clock = service, preview, leases, clock
        self._sources, self._default_source = sources, default_source

    def _renew_drive(self, caller: Caller, params: DriveParams) -> Driven | None:
        """Let what this client drives already hold for longer. None: ``drive`` is to be carried out."""
        session, source = caller.session, params.source or self._default_source
        now_s, twist = self._clock.now_s(), Twist2D(params.linear_m_s, params.angular_rad_s)
        if self._leases.holder(source, now_s) is not session:
            return None
        if not self._service.renew_command(source, twist, session.number):
            return None
        self._leases.renew(source, session, now_s)
        return self._driven_at(twist)

    @method(role=Role.DRIVE, moves=True, renew=_renew_drive)
    def drive(self, caller: Caller, params: DriveParams) -> Driven:
        """Drive at this velocity until the command is replaced or too old; repeat it to keep moving.

        It is too old after the dead-man time (0.5 s, KHAN 0.25 s). Without ``source`` it is one of the robot's default
        source. The answer is what the limits allow of it.
        """
        now_s, source = self._clock.now_s(), params.source or self._default_source
        self._require_control(source, caller, now_s)
        twist = Twist2D(params.linear_m_s, params.angular_rad_s)
        self._service.command(source, twist, caller.session.number)
        answer = self._driven_at(twist)
        self._leases.renew(source, caller.session, now_s)
        return answer

    def _driven_at(self, twist: Twist2D) -> Driven:
        allowed = self._preview.of_twist(twist)
        command = allowed.command
        return Driven(
            linear_m_s=command.linear_m_s,
            angular_rad_s=command.angular_rad_s,
            limited_by=allowed.limited_by,
        )

    def _require_control(self, source: str, caller: Caller, now_s: float) -> None:
        if source in self._sources:  # the robot refuses any other
            try:
                self._leases.require(source, caller.session, now_s)
            except Unserved:
                self._service.record_attempt(source, caller.session.number)
                raise

    @method(role=Role.DRIVE, moves=True)
    def set_wheel_velocities(self, caller: Caller, params: SetWheelVelocitiesParams) -> WheelSpeedsSet:
        """Set the speed of each wheel, with the rules of ``drive``; wheels that are not named stand still."""
        now_s, source = self._clock.now_s(), params.source or self._default_source
        self._require_control(source, caller, now_s)
        velocities = self._service.wheels.wheel_velocities(params.by_name())
        self._service.command(source, velocities, caller.session.number)
        allowed = self._preview.of_wheels(velocities)
        self._leases.renew(source, caller.session, now_s)
        speeds = [allowed.command[name] for name in params.name]
        return WheelSpeedsSet(name=params.name, velocity_rad_s=speeds, limited_by=allowed.limited_by)

    @method(role=Role.OBSERVE, for_guests=True, urgent=True, when_crowded=True)
    def stop(self, caller: Caller, params: StopParams) -> Stopped:
        """Come to rest within the deceleration limit; sources that others drive are held until they let go."""
        drivers = self._leases.drivers(self._clock.now_s())
        self._service.stop(str(caller.session), caller.session.number)
        return Stopped(drivers=drivers, stop_number=self._service.stop_number)

    @method(role=Role.OBSERVE, for_guests=True, urgent=True, when_crowded=True)
    def estop(self, caller: Caller, params: EstopParams) -> Stopped:
        """Stop the motors at once, and until armed again."""
        drivers = self._leases.drivers(self._clock.now_s())
        asked = Sentence("driving.asked", "asked by a client")
        self._service.estop(asked if params.reason == asked else params.reason)
        return Stopped(drivers=drivers, stop_number=self._service.stop_number)

    @method(role=Role.DRIVE, moves=True)
    def arm(self, caller: Caller, params: ArmParams) -> Done:
        """Allow motion after an emergency stop or a fault; with ``latch``, only if that one is the newest."""
        self._service.arm(params.latch)
        self._service.acknowledge_stops(caller.session.number)
        return DONE


def methods(commands: DriveCommands, arm_role: Role) -> tuple[Method, ...]:
    """The methods of this feature; who may ``arm`` is configured."""
    return tuple(replace(row, role=arm_role) if row.name == "arm" else row for row in methods_of(commands))


def driving(
    service: DriveService,
    quadrature: QuadratureService,
    preview: LimitPreview,
    leases: ControlLeases,
    clock: Clock,
    *,
    wheel_names: tuple[str, ...],
    sources: tuple[str, ...],
    default_source: str,
    arm_role: Role,
) -> Feature:
    """The control loop and the reading of encoder edges, and the commands to them."""
    scans = service.keeper.obstacles.scans
    commands = DriveCommands(service, preview, leases, clock, sources=sources, default_source=default_source)
    return Feature(
        "driving",
        services=(
            Service("drive", service.run, critical=True, in_steps=True),
            Service("quadrature", quadrature.run, critical=True),
        ),
        methods=methods(commands, arm_role),
        topics=topics(wheel_names),
        add_metrics=lambda metrics: _add_metrics(metrics, service, quadrature),
        parts={
            "loop": service,
            "limits": service.wheels,
            "edges": quadrature,
            **({} if scans is None else {"scans": scans}),
        },
        configured=("limits",),
    )


def _add_metrics(metrics: Metrics, service: DriveService, quadrature: QuadratureService) -> None:
    metrics.counter("control_steps", "Steps of the control loop.", lambda: service.memory.steps)
    metrics.histogram("control_step_s", "How long a step of the control loop takes.", service.step_times)
    metrics.counters(
        "faults", "Faults that disarmed the robot.", "fault", lambda: service.keeper.announcer.memory.faults
    )
    metrics.counter(
        "loop_pauses", "Pauses of the control loop while it drove: it braked.", lambda: service.memory.pauses
    )
    metrics.counter("internal_errors", "Steps that failed.", lambda: service.memory.internal_errors)
    metrics.counter(
        "encoder_readings_refused",
        "Encoder readings that were rejected.",
        lambda: service.reader.memory.refused,
    )
    metrics.counter(
        "encoder_transitions_illegal",
        "Encoder edges that no wheel can make.",
        lambda: quadrature.illegal_transitions,
    )
    metrics.counter(
        "encoder_levels_repeated",
        "Encoder edges that changed no level.",
        lambda: quadrature.repeated_levels,
    )
    metrics.counter("encoder_edges_lost", "Encoder edges that did not arrive.", lambda: quadrature.lost_edges)
