"""The simulated robot that a configuration describes."""

from chefbotd.link.wires import BITS_A_BYTE, variant_of
from chefbotd.motion.kinematics import ChassisParameters, Kinematics, Side
from chefbotd.sensing.infrared import InfraredParameters
from chefbotd.sensing.lidar import LidarParameters
from chefbotd.settings import Settings
from chefbotd.sim.plant import Chassis, Wheel
from chefbotd.sim.sensors import Divider, InfraredMount, UltrasonicMount
from chefbotd.sim.simulation import Simulation, build_launchpad, build_lidars
from chefbotd.sim.spinning import LidarMount, LidarWire


class CannotSimulateError(Exception):
    """A configuration of a robot that cannot be simulated; its text is ready to be shown."""


def simulation_of(settings: Settings) -> Simulation:
    """What to simulate for this robot: its own wire, line, wheels, divider and sensors, the rest from ``[sim]``.

    Raises:
        ValueError: it cannot be simulated.
    """
    ultrasonic = settings.ultrasonic
    return Simulation(
        settings.sim,
        variant_of(settings.robot.wire),
        _chassis(settings.chassis, settings.encoders.counts_per_turn),
        settings.link.baud / BITS_A_BYTE,
        Divider(settings.battery.reference_v, settings.battery.divider_ratio),
        None
        if ultrasonic is None
        else UltrasonicMount(ultrasonic.base_from_sensor, ultrasonic.field_of_view_rad),
        tuple(map(_infrared, settings.infrared)),
        has_imu=settings.imu is not None,
        lidars=tuple([_lidar(lidar, settings.sim.lidar.height_m) for lidar in settings.lidar]),
    )


def checked_simulation(settings: Settings) -> Simulation:
    """What to simulate for this robot; everything it needs is there.

    Raises:
        CannotSimulateError: it cannot, and why.
        ModuleNotFoundError: its world is a map, and Pillow is not installed.
    """
    try:
        simulation = simulation_of(settings)
        build_launchpad(simulation)
        build_lidars(simulation)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise CannotSimulateError(f"{settings.robot.name} cannot be simulated: {reason}") from error
    return simulation


def _chassis(chassis: ChassisParameters, counts_per_turn: float) -> Chassis:
    """The simulated chassis, with the effective radii and track of the configuration."""
    radii_m = Kinematics(chassis).radii_m
    wheels = [
        Wheel(wheel.side is Side.LEFT, radius_m, wheel.motor_sign, wheel.encoder_sign)
        for wheel, radius_m in zip(chassis.wheels, radii_m, strict=True)
    ]
    return Chassis(tuple(wheels), chassis.effective_track_m, counts_per_turn)


def _lidar(real: LidarParameters, height_m: float) -> LidarMount:
    """The model and mount of the real one; an LD06 has the LD19's protocol."""
    if real.mount_z_m is not None:
        height_m = real.mount_z_m
    wire = LidarWire.LD19 if real.model.is_ldrobot else LidarWire(real.model)
    return LidarMount(real.name, real.base_from_lidar, real.upside_down, height_m, wire)


def _infrared(real: InfraredParameters) -> InfraredMount:
    """A sensor in the real one's mount; its noise and its rays are the simulator's."""
    return InfraredMount(real.channel, real.base_from_sensor, real.field_of_view_rad, real.reference_v)
