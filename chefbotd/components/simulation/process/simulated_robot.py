"""The simulated robot that a configuration describes."""

from statistics import fmean

from chefbotd.components.simulation.chassis import Chassis, Wheel
from chefbotd.components.simulation.parameters.motor import MotorParameters
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.parameters.true import (
    TrueImu,
    TrueLidar,
    TrueParameters,
    TrueWheel,
    resolve_true,
)
from chefbotd.components.simulation.sensors import Divider, InfraredMount, UltrasonicMount
from chefbotd.components.simulation.simulation import Simulation, build_launchpad, build_lidars
from chefbotd.components.simulation.spinning import LidarMount, LidarWire
from chefbotd.core.geometry import Pose2D
from chefbotd.link.wires import BITS_A_BYTE, variant_of
from chefbotd.motion.drive_state import LOADED_SHARE
from chefbotd.motion.kinematics import Kinematics, Side
from chefbotd.sensing.battery import BatteryParameters
from chefbotd.sensing.infrared import InfraredParameters
from chefbotd.sensing.lidar import LidarParameters
from chefbotd.settings import Settings


def sim_of(settings: Settings) -> SimulationParameters:
    """The section ``[sim]``."""
    return settings.of("sim", SimulationParameters)


class CannotSimulateError(Exception):
    """A configuration of a robot that cannot be simulated; its text is ready to be shown."""


SIMULATED_BATTERY = BatteryParameters(
    reference_v=3.3, divider_ratio=5.0, full_v=12.9, empty_v=11.4, low_v=12.0, critical_v=11.7
)
"""ChefBot's, for a simulated robot without [battery]: a motor needs one all the same."""


def nominal_battery(settings: Settings) -> BatteryParameters:
    """The configured battery, or the one that a simulated robot without has."""
    return settings.battery or SIMULATED_BATTERY


def simulation_of(settings: Settings) -> Simulation:
    """What to simulate for this robot: its own wire, line, wheels, divider and sensors, the rest from ``[sim]``.

    Raises:
        ValueError: it cannot be simulated.
    """
    ultrasonic, true = settings.ultrasonic, true_of(settings)
    return Simulation(
        sim_of(settings).model_copy(update={"true": true, "motor": motor_of(settings)}),
        variant_of(settings.robot.wire),
        _chassis(settings, true),
        settings.link.baud / BITS_A_BYTE,
        Divider(nominal_battery(settings).reference_v, _require_given(true.divider_ratio)),
        None
        if ultrasonic is None
        else UltrasonicMount(ultrasonic.base_from_sensor, ultrasonic.field_of_view_rad),
        tuple(map(_infrared, settings.infrared)),
        has_imu=settings.imu is not None,
        lidars=tuple(
            [
                _lidar(lidar, true.lidars[lidar.name], sim_of(settings).lidar.height_m)
                for lidar in settings.lidar
            ]
        ),
    )


SAME_MOTOR, AGREEING = 0.1, 0.25
"""Shares by which speeds may differ: from the simulated motor's own, and the configuration's two statements."""


def motor_of(settings: Settings) -> MotorParameters:
    """The simulated motors: those of ``[sim.motor]``; without it those that the robot's configuration describes.

    These are the usual ones with another gear, so that a rim without load reaches at full duty what the gains'
    feedforward (or the calibrated models) and ``max_rim_speed_m_s`` say. Where the two do not agree, as where the speed
    is only limited, the usual ones stay.
    """
    motor = sim_of(settings).motor
    if "motor" in sim_of(settings).model_fields_set:
        return motor
    radius_m = fmean(Kinematics(settings.chassis).radii_m)
    by_gains_m_s = _free_by_feedforward(settings, radius_m)
    by_limit_m_s = settings.drive.max_rim_speed_m_s / LOADED_SHARE
    usual_m_s = motor.no_load_speed_rad_s * radius_m
    is_other = abs(by_limit_m_s / usual_m_s - 1) > SAME_MOTOR
    if by_gains_m_s is None or not is_other or abs(by_gains_m_s / by_limit_m_s - 1) > AGREEING:
        return motor
    gear = by_limit_m_s / usual_m_s
    return motor.model_copy(
        update={
            "no_load_speed_rpm": motor.no_load_speed_rpm * gear,
            "stall_torque_n_m": motor.stall_torque_n_m / gear,
            "rotor_inertia_kg_m2": motor.rotor_inertia_kg_m2 / gear**2,
        }
    )


def _free_by_feedforward(settings: Settings, radius_m: float) -> float | None:
    """The rim's speed at full duty, by calibrated models or else by the gains; None without either."""
    most = settings.drive.max_duty
    if settings.drive.motors:
        models = [model.forward for model in settings.drive.motors.values()]
        return fmean((most - one.dead_zone_duty) * one.gain_rad_s_per_duty for one in models) * radius_m
    gains = settings.pid
    return (most - gains.ks) / gains.kv if gains.kv else None


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


def true_of(settings: Settings) -> TrueParameters:
    """The simulated robot as it is, every value given: what a calibration of it should find.

    Raises:
        ValueError: ``[sim.true]`` names a wheel or a lidar that the robot does not have.
    """
    radii_m = Kinematics(settings.chassis).radii_m
    names = [wheel.name for wheel in settings.chassis.wheels]
    lidars, given = {lidar.name: lidar for lidar in settings.lidar}, sim_of(settings).true
    for section, named, existing in (("wheels", given.wheels, names), ("lidars", given.lidars, lidars)):
        if unknown := sorted(named.keys() - set(existing)):
            raise ValueError(
                f"sim.true.{section} names {', '.join(unknown)}, the robot has {', '.join(existing) or 'none'}"
            )
    configured = TrueParameters(
        track_width_m=settings.chassis.effective_track_m,
        wheels={name: TrueWheel(radius_m=radius_m) for name, radius_m in zip(names, radii_m, strict=True)},
        imu=TrueImu(mount_heading_rad=settings.imu.mount_heading_rad if settings.imu else 0.0),
        lidars={name: _as_configured(lidar) for name, lidar in lidars.items()},
        divider_ratio=nominal_battery(settings).divider_ratio,
    )
    return resolve_true(given, configured, sim_of(settings).seed)


def _as_configured(lidar: LidarParameters) -> TrueLidar:
    return TrueLidar(mount_x_m=lidar.mount_x_m, mount_y_m=lidar.mount_y_m, mount_yaw_rad=lidar.mount_yaw_rad)


def _require_given(value: float | None) -> float:
    """A value of a robot that has every value given."""
    if value is None:
        raise TypeError("a value of the simulated robot is not given")
    return value


def _chassis(settings: Settings, true: TrueParameters) -> Chassis:
    """The simulated chassis: wiring as configured, sizes and flaws as they are."""
    wheels = []
    for wheel in settings.chassis.wheels:
        own = true.wheels[wheel.name]
        wheels.append(
            Wheel(
                wheel.side is Side.LEFT,
                _require_given(own.radius_m),
                wheel.motor_sign,
                wheel.encoder_sign,
                own.forward,
                own.reverse,
                own.backlash_rad,
            )
        )
    return Chassis(tuple(wheels), _require_given(true.track_width_m), settings.encoders.counts_per_turn)


def _lidar(real: LidarParameters, true: TrueLidar, height_m: float) -> LidarMount:
    """The model of the real one, where it is; an LD06 has the LD19's protocol."""
    if real.mount_z_m is not None:
        height_m = real.mount_z_m
    wire = LidarWire.LD19 if real.model.is_ldrobot else LidarWire(real.model)
    place = Pose2D(
        _require_given(true.mount_x_m), _require_given(true.mount_y_m), _require_given(true.mount_yaw_rad)
    )
    errors = true.range_offset_m, true.range_scale, true.lone_share
    return LidarMount(real.name, place, real.upside_down, height_m, wire, *errors)


def _infrared(real: InfraredParameters) -> InfraredMount:
    """A sensor in the real one's mount; its noise and its rays are the simulator's."""
    return InfraredMount(real.channel, real.base_from_sensor, real.field_of_view_rad, real.reference_v)
