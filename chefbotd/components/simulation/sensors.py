"""The readings of the simulated range finders and IMU, with noise from a seeded generator.

The infrared one is a Sharp GP2Y0A02YK: its voltage rises with distance up to its fold, and falls beyond.
"""

import math
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from msgspec import field

from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.parameters.motor import GRAVITY_M_S2, SimBatteryParameters
from chefbotd.components.simulation.parameters.simulation import SimImuParameters, SimUltrasonicParameters
from chefbotd.components.simulation.parameters.true import TrueImu
from chefbotd.components.simulation.plant import Supply
from chefbotd.components.simulation.world import World
from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.core.record import Record

# Rest voltage of a 12 V lead-acid battery at 25 degrees C by state of charge, as battery makers publish it.
# Tenths of the charge, from empty to full.
REST_VOLTAGE_V = (10.50, 11.51, 11.66, 11.81, 11.96, 12.10, 12.24, 12.37, 12.50, 12.62, 12.73)
TENTHS = tuple(pairwise(REST_VOLTAGE_V))
ADC_MAX = 4095


class Divider(Record, frozen=True):
    """The voltage divider between the battery and the ADC, and the ADC's full scale."""

    reference_v: float = 3.3
    ratio: float = 4.0


class Battery(Record, frozen=True):
    """A battery with ``charge_share`` (0 to 1) left in it."""

    parameters: SimBatteryParameters
    charge_share: float

    @classmethod
    def fresh(cls, parameters: SimBatteryParameters) -> "Battery":
        """The battery at the start of the simulation."""
        return cls(parameters, parameters.start_charge_share)

    @property
    def supply(self) -> Supply:
        """The voltage and the resistance that the motors see."""
        tenths = 10 * self.charge_share
        number = min(int(tenths), 9)
        below_v, above_v = TENTHS[number]
        rest_v = below_v + (above_v - below_v) * (tenths - number)
        return Supply(rest_v, self.parameters.resistance_ohm, self.parameters.electronics_current_a)

    def drained(self, current_a: float, duration_s: float) -> "Battery":
        """The battery after it has supplied ``current_a`` for ``duration_s``; a negative current charges it."""
        used = current_a * duration_s / (3600 * self.parameters.capacity_ah)
        return Battery(self.parameters, min(max(self.charge_share - used, 0.0), 1.0))


def adc_counts(terminal_v: float, divider: Divider, noise_counts: float = 0.0) -> int:
    """The 12-bit reading of this voltage through the divider."""
    ideal = terminal_v / divider.ratio / divider.reference_v * ADC_MAX
    return min(max(round(ideal + noise_counts), 0), ADC_MAX)


# MPU-6050 at its power-on ranges, 2 g and 250 degrees/s (register map RM-MPU-6000A, sections 4.17, 4.19).
COUNTS_PER_G = 16_384
COUNTS_PER_DEG_S = 131
INT16_MAX = 32_767


class UltrasonicMount(Record, frozen=True):
    """The sensor's mount on the robot, and the full angle of its cone."""

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
    """The nearest hit in the sensor's cone is the echo; it may be lost, or be that of something farther."""

    def __init__(
        self,
        parameters: SimUltrasonicParameters,
        mount: UltrasonicMount,
        world: World,
        offset_m: float = 0.0,
        *,
        far_echo_share: float = 0.0,
        seed: int = 0,
    ) -> None:
        """``offset_m`` is how much too far it reads; ``far_echo_share`` counts beside the parameters' own."""
        self._parameters, self._offset_m = parameters, offset_m
        self._fan = Fan(world, mount.base_from_sensor, mount.field_of_view_rad, parameters.rays)
        self._far_share = parameters.far_echo_share + far_echo_share
        self._chance = np.random.default_rng((seed, ULTRASONIC_STREAM))
        self._readings = self._to_lose = 0

    def distance_m(self, world_from_base: Pose2D, chance: np.random.Generator) -> float | None:
        """Distance to what returns the first echo; None when nothing in range does, or the echo is lost."""
        noise, luck = chance.standard_normal(), chance.random()
        distance_m = self._fan.nearest_m(world_from_base) + float(noise) * self._parameters.noise_m
        farthest_m = self._parameters.max_range_m
        if self._is_lost(luck) or distance_m > farthest_m:
            return None
        if self._far_share and self._chance.random() < self._far_share:
            distance_m = self._chance.uniform(distance_m, farthest_m)
        return max(distance_m + self._offset_m, self._parameters.min_range_m)

    def _is_lost(self, luck: float) -> bool:
        """Whether this echo is lost: by chance, in a burst that began before, or because it is its turn."""
        self._readings += 1
        if self._to_lose == 0 and luck < self._parameters.lost_echo_share:
            self._to_lose = self._parameters.lost_echo_burst
        if self._to_lose:
            self._to_lose -= 1
            return True
        every = self._parameters.lost_echo_every
        return every > 0 and self._readings % every == 0


ULTRASONIC_STREAM, INFRARED_STREAM = 71, 72
"""Their random numbers are their own, so that what they misread changes no other sensor's noise."""


class Tilt(Record, frozen=True):
    """How a robot that is not level leans (pitch about its y axis: nose down, then roll about x), and what it feels.

    ``rate_rad_s`` and ``felt_m_s2`` (gravity included) are along the axes of the tilted base.
    """

    pitch_rad: float
    roll_rad: float
    rate_rad_s: tuple[float, float, float]
    felt_m_s2: tuple[float, float, float]


class ImuMotion(Record, frozen=True):
    """The motion that an IMU measures: heading (world frame), angular rate, and acceleration in the base frame.

    ``turned_rad`` is the turn since power-on, not wrapped. ``tilt`` None: the robot is level.
    """

    heading_rad: float
    angular_rad_s: float
    forward_m_s2: float
    leftward_m_s2: float
    turned_rad: float = 0.0
    tilt: Tilt | None = None


class Imu:
    """Heading relative to where the robot pointed when the board booted, drifting from there."""

    def __init__(
        self,
        parameters: SimImuParameters,
        booted_s: float,
        booted: ImuMotion,
        true: TrueImu | None = None,
    ) -> None:
        """``booted`` is the motion at ``booted_s``; ``true`` None: an IMU without errors of mount and scale."""
        self._parameters, self._booted_s, self._booted = parameters, booted_s, booted
        self._true = TrueImu() if true is None else true
        self._base_from_sensor = _rotation(self._true)

    def orientation(
        self, motion: ImuMotion, at_s: float, chance: np.random.Generator
    ) -> tuple[float, float, float, float]:
        """The quaternion (x, y, z, w) of a level robot with this motion at ``at_s``.

        Its heading is 0 at boot, wherever the IMU's x axis points.
        """
        noise, true = chance.standard_normal(), self._true
        drift_rad = self._parameters.heading_drift_rad_s * (at_s - self._booted_s)
        error_rad = (
            self._parameters.heading_bias_rad + drift_rad + self._parameters.heading_noise_rad * float(noise)
        )
        error_rad += (true.gyro_scale - 1) * (motion.turned_rad - self._booted.turned_rad)
        half = wrap_angle(motion.heading_rad - self._booted.heading_rad + error_rad) / 2
        quaternion = 0.0, 0.0, math.sin(half), math.cos(half)
        if motion.tilt is not None:
            quaternion = _leaning(quaternion, motion.tilt.pitch_rad, motion.tilt.roll_rad)
        if not (true.mount_pitch_rad or true.mount_roll_rad):
            return quaternion
        return _leaning(quaternion, true.mount_pitch_rad, true.mount_roll_rad)

    def counts(
        self, motion: ImuMotion, chance: np.random.Generator
    ) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
        """Raw int16 readings, acceleration (gravity included) and angular rate, each x y z."""
        tilt = motion.tilt
        feels = (motion.forward_m_s2, motion.leftward_m_s2, GRAVITY_M_S2) if tilt is None else tilt.felt_m_s2
        turns = (0.0, 0.0, motion.angular_rad_s) if tilt is None else tilt.rate_rad_s
        felt = np.array(feels) @ self._base_from_sensor
        felt += self._true.acceleration_bias_m_s2
        felt += self._parameters.acceleration_noise_m_s2 * chance.standard_normal(3)
        rate = np.array(turns) * self._true.gyro_scale @ self._base_from_sensor
        rate += self._parameters.gyro_bias_rad_s
        rate += self._parameters.gyro_noise_rad_s * chance.standard_normal(3)
        return (
            _int16(felt / GRAVITY_M_S2 * COUNTS_PER_G),
            _int16(np.degrees(rate) * COUNTS_PER_DEG_S),
        )


Quaternion: TypeAlias = tuple[float, float, float, float]
"""x, y, z, w."""


def _leaning(quaternion: Quaternion, pitch_rad: float, roll_rad: float) -> Quaternion:
    """The orientation after a turn about its own y axis, then one about its own x axis."""
    return _product(
        _product(quaternion, (0.0, math.sin(pitch_rad / 2), 0.0, math.cos(pitch_rad / 2))),
        (math.sin(roll_rad / 2), 0.0, 0.0, math.cos(roll_rad / 2)),
    )


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    """The turn ``b`` in the axes that ``a`` has turned."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _rotation(true: TrueImu) -> Vector:
    """The matrix of the IMU's axes in the base frame: a turn about z, then y, then x."""
    heading_rad = true.mount_heading_rad or 0.0
    cos_h, cos_p, cos_r = map(math.cos, (heading_rad, true.mount_pitch_rad, true.mount_roll_rad))
    sin_h, sin_p, sin_r = map(math.sin, (heading_rad, true.mount_pitch_rad, true.mount_roll_rad))
    return np.array(
        [
            [cos_h * cos_p, cos_h * sin_p * sin_r - sin_h * cos_r, cos_h * sin_p * cos_r + sin_h * sin_r],
            [sin_h * cos_p, sin_h * sin_p * sin_r + cos_h * cos_r, sin_h * sin_p * cos_r - cos_h * sin_r],
            [-sin_p, cos_p * sin_r, cos_p * cos_r],
        ]
    )


def _int16(values: Vector) -> tuple[int, int, int]:
    x, y, z = np.clip(np.rint(values), -INT16_MAX - 1, INT16_MAX)
    return int(x), int(y), int(z)


NEAR_M = np.array([0.00, 0.05, 0.10, 0.13, 0.15])
NEAR_V = np.array([0.50, 1.30, 2.20, 2.65, 2.75])
"""Before the fold, read off the data sheet's figure."""

FAR_M = np.array([0.15, 0.20, 0.25, 0.30, 0.40, 0.50, 0.60, 0.80, 1.00, 1.20, 1.50, 2.50])
FAR_V = np.array([2.75, 2.70, 2.40, 2.00, 1.55, 1.25, 1.03, 0.78, 0.62, 0.51, 0.40, 0.25])
"""From the fold outwards; between two points the voltage is linear in one over the distance."""


INFRARED_RAYS = 3
"""The number of rays across its cone."""


GLITCH_V = 0.3
"""What a sample shows that sees nothing in range."""


class InfraredMount(Record, frozen=True):
    """One sensor: the board's analogue input, where it is on the robot, and the voltage of a full reading."""

    channel: int = 0
    base_from_sensor: Pose2D = Pose2D()
    field_of_view_rad: float = 0.1
    reference_v: float = 3.3


class Infrared:
    """The sensor on the robot."""

    def __init__(
        self,
        mount: InfraredMount,
        world: World,
        *,
        rays: int = INFRARED_RAYS,
        noise_v: float = 0.01,
        offset_m: float = 0.0,
        glitch_share: float = 0.0,
        seed: int = 0,
    ) -> None:
        """``offset_m`` is how much too far it reads; ``glitch_share`` of the samples shows nothing in range."""
        self._reference_v, self._noise_v, self._offset_m = mount.reference_v, noise_v, offset_m
        self._glitch_share = glitch_share
        self._chance = np.random.default_rng((seed, INFRARED_STREAM, mount.channel))
        self._fan = Fan(world, mount.base_from_sensor, mount.field_of_view_rad, rays)
        self.channel = mount.channel

    def adc_counts(self, world_from_base: Pose2D, chance: np.random.Generator) -> int:
        """The 12-bit reading of the nearest object in its cone."""
        volts = voltage(max(self._fan.nearest_m(world_from_base) + self._offset_m, 0.0))
        if self._glitch_share and self._chance.random() < self._glitch_share:
            volts = GLITCH_V
        volts += float(chance.standard_normal()) * self._noise_v
        return min(max(round(volts / self._reference_v * ADC_MAX), 0), ADC_MAX)


def voltage(distance_m: float) -> float:
    """The sensor's output for a white card at this distance."""
    if distance_m <= NEAR_M[-1]:
        return float(np.interp(distance_m, NEAR_M, NEAR_V))
    return float(np.interp(1 / distance_m, 1 / FAR_M[::-1], FAR_V[::-1]))
