"""What a perfect calibration of a simulated robot would find, by the keys of its configuration."""

from chefbotd.components.simulation.plant import Plant
from chefbotd.components.simulation.process.simulated_robot import nominal_battery, simulation_of, true_of
from chefbotd.settings import Settings

CURVE_STEP_S = 0.001

ROUNDING_M = 0.005
"""The sketch rounds whole centimetres down, so that it reads half of one too little in the mean."""


def true_values(settings: Settings, voltage_v: float) -> dict[str, float]:
    """The true value of each key that a step of the calibration may find.

    ``voltage_v`` is the battery's, as the robot's own divider shows it: the motors' gains and dead zones depend on it.
    """
    true, chassis = true_of(settings), settings.chassis
    values = {
        "chassis.track_multiplier": (true.track_width_m or 0.0) / chassis.track_width_m,
        "battery.divider_ratio": true.divider_ratio or 0.0,
        "ultrasonic.offset_m": true.ultrasonic_offset_m - ROUNDING_M,
        "imu.mount_heading_rad": true.imu.mount_heading_rad or 0.0,
        "imu.gyro_scale": true.imu.gyro_scale,
    }
    for wheel in chassis.wheels:
        radius_m = true.wheels[wheel.name].radius_m or 0.0
        values[f"chassis.{wheel.side}_radius_multiplier"] = radius_m / wheel.radius_m
    for name, lidar in true.lidars.items():
        for key in ("mount_x_m", "mount_y_m", "mount_yaw_rad"):
            values[f"lidar.{name}.{key}"] = getattr(lidar, key)
    return values | _motors(settings, voltage_v)


def _motors(settings: Settings, voltage_v: float) -> dict[str, float]:
    """Each motor in both directions."""
    simulation, full_duty = simulation_of(settings), settings.drive.max_duty
    parameters = simulation.parameters
    plant = Plant(parameters.motor, parameters.body, CURVE_STEP_S, simulation.chassis)
    true_v = voltage_v * simulation.divider.ratio / nominal_battery(settings).divider_ratio
    values = {}
    for number, wheel in enumerate(settings.chassis.wheels):
        for direction in ("forward", "reverse"):
            curve = plant.curve(number, true_v, forward=direction == "forward")
            key = f"drive.motors.{wheel.name}.{direction}"
            values[f"{key}.dead_zone_duty"] = curve.dead_zone_share * full_duty
            values[f"{key}.gain_rad_s_per_duty"] = curve.gain_rad_s / full_duty
            values[f"{key}.time_constant_s"] = curve.time_constant_s
    return values
