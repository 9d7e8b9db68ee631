"""The readings of the simulated ultrasonic sensor and IMU, with noise from a seeded generator."""

import math
from dataclasses import dataclass, field

import numpy as np

from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.sim.arrays import Vector
from chefbotd.sim.world import World
from chefbotd.sim_parameters.motor import GRAVITY_M_S2
from chefbotd.sim_parameters.sensors import ImuParameters, UltrasonicParameters

# MPU-6050 at its power-on ranges, 2 g and 250 degrees/s (register map RM-MPU-6000A, sections 4.17, 4.19).
COUNTS_PER_G = 16_384
COUNTS_PER_DEG_S = 131
INT16_MAX = 32_767


@dataclass(frozen=True, slots=True)
class UltrasonicMount:
    """Where the sensor sits on the robot, and its cone (full angle)."""

    base_from_sensor: Pose2D = field(default_factory=lambda: Pose2D(0.15))
    field_of_view_rad: float = 0.26


class Fan:
    """Rays spread evenly over a sensor's cone; one ray alone looks straight ahead."""

    def __init__(self, world: World, base_from_sensor: Pose2D, field_of_view_rad: float, rays: int) -> None:
        self._world, self._base_from_sensor = world, base_from_sensor
        half = field_of_view_rad / 2
        self._bearings_rad: Vector = np.linspace(-half, half, rays) if rays > 1 else np.zeros(1)

    def nearest_m(self, world_from_base: Pose2D) -> float:
        """Distance from the sensor to the nearest wall in the cone; inf where there is none."""
        sensor = world_from_base.compose(self._base_from_sensor)
        bearings_rad = sensor.heading_rad + self._bearings_rad
        return float(self._world.first_hits_m((sensor.x_m, sensor.y_m), bearings_rad).min())


class Ultrasonic:
    """The nearest hit in the sensor's cone is the echo."""

    def __init__(self, parameters: UltrasonicParameters, mount: UltrasonicMount, world: World) -> None:
        self._parameters = parameters
        self._fan = Fan(world, mount.base_from_sensor, mount.field_of_view_rad, parameters.rays)

    def distance_m(self, world_from_base: Pose2D, chance: np.random.Generator) -> float | None:
        """Distance to what returns the first echo; None when nothing in range does."""
        noise, luck = chance.standard_normal(), chance.random()
        distance_m = self._fan.nearest_m(world_from_base) + float(noise) * self._parameters.noise_m
        if distance_m > self._parameters.max_range_m or luck < self._parameters.lost_echo_share:
            return None
        return max(distance_m, self._parameters.min_range_m)


@dataclass(frozen=True, slots=True)
class Motion:
    """The motion that an IMU measures: heading (world frame), angular rate, and acceleration in the base frame."""

    heading_rad: float
    angular_rad_s: float
    forward_m_s2: float
    leftward_m_s2: float


class Imu:
    """Heading relative to where the robot pointed when the board booted, drifting from there."""

    def __init__(self, parameters: ImuParameters, booted_s: float, boot_heading_rad: float) -> None:
        self._parameters, self._booted_s, self._boot_heading_rad = parameters, booted_s, boot_heading_rad

    def orientation(
        self, motion: Motion, at_s: float, chance: np.random.Generator
    ) -> tuple[float, float, float, float]:
        """The quaternion (x, y, z, w) of a level robot that moves so at ``at_s``."""
        noise = chance.standard_normal()
        drift_rad = self._parameters.heading_drift_rad_s * (at_s - self._booted_s)
        error_rad = (
            self._parameters.heading_bias_rad + drift_rad + self._parameters.heading_noise_rad * float(noise)
        )
        half = wrap_angle(motion.heading_rad - self._boot_heading_rad + error_rad) / 2
        return 0.0, 0.0, math.sin(half), math.cos(half)

    def counts(
        self, motion: Motion, chance: np.random.Generator
    ) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
        """Raw int16 readings, acceleration (gravity included) and angular rate, each x y z."""
        felt = np.array([motion.forward_m_s2, motion.leftward_m_s2, GRAVITY_M_S2])
        felt += self._parameters.acceleration_noise_m_s2 * chance.standard_normal(3)
        rate = np.array([0.0, 0.0, motion.angular_rad_s]) + self._parameters.gyro_bias_rad_s
        rate += self._parameters.gyro_noise_rad_s * chance.standard_normal(3)
        return (
            _int16(felt / GRAVITY_M_S2 * COUNTS_PER_G),
            _int16(np.degrees(rate) * COUNTS_PER_DEG_S),
        )


def _int16(values: Vector) -> tuple[int, int, int]:
    x, y, z = np.clip(np.rint(values), -INT16_MAX - 1, INT16_MAX)
    return int(x), int(y), int(z)
