"""The feature: driving."""

from collections.abc import Mapping

from chefbotd.clock import Clock
from chefbotd.core.commands import Allowed
from chefbotd.core.geometry import Twist2D
from chefbotd.features.driving.methods import DrivingMethods, methods, topics
from chefbotd.features.driving.quadrature import QuadratureService
from chefbotd.features.driving.service import DriveService
from chefbotd.features.feature import Feature, Service
from chefbotd.metrics import Metrics
from chefbotd.motion.limit_preview import LimitPreview
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.roles import Role


class PreviewedDrive:
    """Hands commands to the drive service, and says what the limits allow of them."""

    def __init__(self, service: DriveService, preview: LimitPreview) -> None:
        self._service, self._preview = service, preview
        self.stop, self.estop, self.arm, self.resume = (
            service.stop,
            service.estop,
            service.arm,
            service.resume,
        )

    def drive(self, source: str, twist: Twist2D) -> Allowed[Twist2D]:
        """Take a velocity command."""
        self._service.command(source, twist)
        return self._preview.of_twist(twist)

    def set_wheel_velocities(
        self, source: str, velocity_rad_s: Mapping[str, float]
    ) -> Allowed[Mapping[str, float]]:
        """Take a command for each wheel."""
        wanted = self._service.wheels.wheel_velocities(velocity_rad_s)
        self._service.command(source, wanted)
        return self._preview.of_wheels(wanted)


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
    handlers = DrivingMethods(
        PreviewedDrive(service, preview), leases, clock, sources=sources, default_source=default_source
    )
    return Feature(
        "driving",
        services=(
            Service("drive", service.run, critical=True, in_steps=True),
            Service("quadrature", quadrature.run, critical=True),
        ),
        methods=methods(handlers, arm_role),
        topics=topics(wheel_names),
        add_metrics=lambda metrics: _add_metrics(metrics, service, quadrature),
        parts=(service, quadrature, preview),
    )


def _add_metrics(metrics: Metrics, service: DriveService, quadrature: QuadratureService) -> None:
    metrics.counter("control_steps", "Steps of the control loop.", lambda: service.steps)
    metrics.histogram("control_step_s", "How long a step of the control loop takes.", service.step_times)
    metrics.counters(
        "faults", "Faults that disarmed the robot.", "fault", lambda: service.keeper.announcer.faults
    )
    metrics.counter("internal_errors", "Steps that failed.", lambda: service.internal_errors)
    metrics.counter(
        "encoder_readings_refused",
        "Encoder readings that were rejected.",
        lambda: service.reader.refused,
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
