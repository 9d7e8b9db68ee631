"""The section ``[sim.true]``: how the simulated robot differs from its configuration, and robots drawn at random.

A value that the configuration has as well is given here in the same unit, and as it is without one: a calibration that
changes the configuration does not change the robot.
"""

import math
import random
from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import Any

from pydantic import Field

from chefbotd.core.parameters import Parameters, section

Factor = Field(1.0, ge=0.25, le=4)


class TrueMotor(Parameters):
    """Factors on what ``[sim.motor]`` says of a motor, in one direction of the wheel.

    ``gain`` is that of its speed for a duty beyond the dead zone, ``dead_zone`` that of the duty at which it turns,
    friction included, and ``time_constant`` that of its approach to a speed.
    """

    gain: float = Factor
    """A factor on the speed for a duty beyond the dead zone."""
    dead_zone: float = Factor
    """A factor on the duty at which the wheel turns, friction included."""
    time_constant: float = Factor
    """A factor on the time that it takes to approach a speed."""


class TrueWheel(Parameters):
    """A wheel; ``radius_m`` None: the configured one, with its side's multiplier.

    ``backlash_rad`` is the play between the encoder and the wheel, of which a half is on either side.
    """

    radius_m: float | None = Field(None, gt=0, le=1)
    """The wheel's true radius; left out, the configured one with its side's multiplier."""
    backlash_rad: float = Field(0.0, ge=0, le=0.5)
    forward: TrueMotor = section()
    reverse: TrueMotor = section()


class TrueImu(Parameters):
    """An IMU whose gyroscope shows ``gyro_scale`` times the rate, and how its axes are turned from the base's.

    ``mount_heading_rad`` None: as configured. The turns are about z, then y (``mount_pitch_rad``), then x. The bias is
    that of the accelerometer (x, y, z); bias, drift and noise of the rest are those of ``[sim.imu]``.
    """

    gyro_scale: float = Field(1.0, ge=0.5, le=2)
    """What the gyroscope shows of a turn, as a factor."""
    mount_heading_rad: float | None = Field(None, ge=-math.pi, le=math.pi)
    """How its axes are turned about z; left out, as configured."""
    mount_pitch_rad: float = Field(0.0, ge=-1, le=1)
    """How its axes are turned about y, after z."""
    mount_roll_rad: float = Field(0.0, ge=-1, le=1)
    """How its axes are turned about x, after z and y."""
    acceleration_bias_m_s2: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The accelerometer's bias on x, y and z."""


class TrueLidar(Parameters):
    """A lidar's mount (None: as configured); it reads ``range_scale`` times the range, and ``range_offset_m`` more.

    ``lone_share`` of its beams is noise, beside what ``[sim.lidar]`` says.
    """

    mount_x_m: float | None = Field(None, ge=-5, le=5)
    """How far ahead it truly is; left out, as configured."""
    mount_y_m: float | None = Field(None, ge=-5, le=5)
    """How far to the left it truly is; left out, as configured."""
    mount_yaw_rad: float | None = Field(None, ge=-math.tau, le=math.tau)
    """Where its zero mark truly points; left out, as configured."""
    range_offset_m: float = Field(0.0, ge=-0.5, le=0.5)
    """By how much it reads too far."""
    range_scale: float = Field(1.0, ge=0.5, le=2)
    """What it reads of a range, as a factor."""
    lone_share: float = Field(0.0, ge=0, le=1)


class Drawn(StrEnum):
    """How a robot is made where nothing is given: exactly as configured, or at random within ``BOUNDS``."""

    PERFECT = "perfect"
    PLAUSIBLE = "plausible"
    IMPERFECT = "imperfect"


class TrueParameters(Parameters):
    """The simulated robot as it is. In a configuration it may be what is ``drawn`` alone: ``true = "imperfect"``.

    ``seed`` (None: that of ``[sim]``) is of what is drawn; a value given beside it stays as given. The track (None: the
    configured one, with its multiplier) is that of turning. A side's slip is the constant share of its rim travel that
    does not become motion over the ground. The variances are those of random slip, in travel per metre and in heading
    per radian turned. The ultrasonic and infrared sensors read by an offset too far, and a share of their readings is of
    something farther or of nothing, beside what ``[sim]`` says; ``divider_ratio`` None: as configured. ``wheels`` and
    ``lidars`` are by their names.
    """

    drawn: Drawn = Drawn.PERFECT
    """What is not given is ``perfect`` (as configured), or drawn from the seed: ``plausible`` or
    ``imperfect``."""
    seed: int | None = Field(None, ge=0)
    """What is drawn from; left out, the seed of ``[sim]``."""
    track_width_m: float | None = Field(None, gt=0, le=10)
    """The true track of turning; left out, the configured one with its multiplier."""
    wheels: Mapping[str, TrueWheel] = {}
    left_slip: float = Field(0.0, ge=0, lt=1)
    """The share of the left rims' travel that is always lost."""
    right_slip: float = Field(0.0, ge=0, lt=1)
    """The share of the right rims' travel that is always lost."""
    travel_variance_m2_per_m: float = Field(0.0, ge=0, le=0.01)
    """The variance of random slip in travel."""
    turn_variance_rad2_per_rad: float = Field(0.0, ge=0, le=0.01)
    """The variance of random slip in heading."""
    imu: TrueImu = section()
    lidars: Mapping[str, TrueLidar] = {}
    ultrasonic_offset_m: float = Field(0.0, ge=-0.5, le=0.5)
    """By how much the ultrasonic sensor truly reads too far."""
    infrared_offset_m: float = Field(0.0, ge=-0.5, le=0.5)
    """By how much the infrared sensors truly read too far."""
    far_echo_share: float = Field(0.0, ge=0, le=1)
    """The share of ultrasonic readings that are of something farther."""
    infrared_glitch_share: float = Field(0.0, ge=0, le=1)
    """The share of infrared readings that show nothing."""
    divider_ratio: float | None = Field(None, gt=0, le=100)
    """The battery's true divider; left out, as configured."""


class Bounds(Parameters):
    """How far a drawn robot is off its configuration, to either side and evenly spread; all are assumed.

    Shares are of the configured value. ``mount_rad`` is for each axis of the IMU. The variances are not drawn: they are
    those that the OptiOdom runs show.
    """

    radius_share: float
    track_share: float
    gain_share: float
    dead_zone_share: float
    time_constant_share: float
    backlash_rad: float
    gyro_scale_share: float
    mount_rad: float
    acceleration_bias_m_s2: float
    lidar_mount_m: float
    lidar_mount_rad: float
    range_offset_m: float
    lidar_range_offset_m: float
    divider_share: float
    far_echo_share: float
    infrared_glitch_share: float
    lone_share: float
    travel_variance_m2_per_m: float = 6e-7
    turn_variance_rad2_per_rad: float = 2.5e-5


_PLAUSIBLE_AND_IMPERFECT: Mapping[str, tuple[float, float]] = {
    "radius_share": (0.003, 0.01),
    "track_share": (0.01, 0.03),
    "gain_share": (0.04, 0.1),
    "dead_zone_share": (0.1, 0.3),
    "time_constant_share": (0.1, 0.3),
    "backlash_rad": (math.radians(0.5), math.radians(1.5)),
    "gyro_scale_share": (0.005, 0.01),
    "mount_rad": (math.radians(0.5), math.radians(2)),
    "acceleration_bias_m_s2": (0.2, 0.5),
    "lidar_mount_m": (0.005, 0.015),
    "lidar_mount_rad": (math.radians(0.5), math.radians(2)),
    "range_offset_m": (0.005, 0.02),
    "lidar_range_offset_m": (0.005, 0.01),
    "divider_share": (0.01, 0.03),
    "far_echo_share": (0.02, 0.1),
    "infrared_glitch_share": (0.02, 0.1),
    "lone_share": (0.003, 0.02),
}

BOUNDS: Mapping[Drawn, Bounds] = MappingProxyType(
    {
        drawn: Bounds.model_validate({name: most[column] for name, most in _PLAUSIBLE_AND_IMPERFECT.items()})
        for column, drawn in enumerate((Drawn.PLAUSIBLE, Drawn.IMPERFECT))
    }
)
"""Of a robot that was built with care, and of one that is wrong in everything that a calibration finds."""


def resolve_true(given: TrueParameters, configured: TrueParameters, seed: int) -> TrueParameters:
    """The robot with every value given: as ``given``, else as drawn from the seed, else as ``configured``."""
    robot = configured
    if given.drawn is not Drawn.PERFECT:
        seed = seed if given.seed is None else given.seed
        robot = _draw_robot(configured, BOUNDS[given.drawn], random.Random(seed))
    own = given.model_dump(exclude_unset=True, exclude_none=True, exclude={"drawn", "seed"})
    return TrueParameters.model_validate(_merge_tables(robot.model_dump(exclude={"drawn", "seed"}), own))


def _merge_tables(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """A table with the values of another put over its own, to any depth."""
    merged = dict(below)
    for key, value in above.items():
        inner = merged.get(key)
        merged[key] = (
            _merge_tables(inner, value) if isinstance(inner, dict) and isinstance(value, dict) else value
        )
    return merged


def _draw_robot(configured: TrueParameters, bounds: Bounds, chance: random.Random) -> TrueParameters:
    """A robot that differs from the configured one; each value that the configuration has must be given."""

    def off(most: float) -> float:
        return chance.uniform(-most, most)

    def near(value: float | None, share: float) -> float | None:
        drawn = 1 + off(share)
        return None if value is None else value * drawn

    def beside(value: float | None, most: float) -> float | None:
        drawn = off(most)
        return None if value is None else value + drawn

    def motor() -> TrueMotor:
        return TrueMotor(
            gain=1 + off(bounds.gain_share),
            dead_zone=1 + off(bounds.dead_zone_share),
            time_constant=1 + off(bounds.time_constant_share),
        )

    def wheel(own: TrueWheel) -> TrueWheel:
        return TrueWheel(
            radius_m=near(own.radius_m, bounds.radius_share),
            backlash_rad=chance.uniform(0, bounds.backlash_rad),
            forward=motor(),
            reverse=motor(),
        )

    def lidar(own: TrueLidar) -> TrueLidar:
        return TrueLidar(
            mount_x_m=beside(own.mount_x_m, bounds.lidar_mount_m),
            mount_y_m=beside(own.mount_y_m, bounds.lidar_mount_m),
            mount_yaw_rad=beside(own.mount_yaw_rad, bounds.lidar_mount_rad),
            range_offset_m=off(bounds.lidar_range_offset_m),
            lone_share=unkind.uniform(0, bounds.lone_share),
        )

    unkind = random.Random(chance.getstate()[1][0])  # of its own, so that no other value depends on it
    most_m_s2 = bounds.acceleration_bias_m_s2
    return TrueParameters(
        track_width_m=near(configured.track_width_m, bounds.track_share),
        wheels={name: wheel(own) for name, own in configured.wheels.items()},
        travel_variance_m2_per_m=bounds.travel_variance_m2_per_m,
        turn_variance_rad2_per_rad=bounds.turn_variance_rad2_per_rad,
        imu=TrueImu(
            gyro_scale=1 + off(bounds.gyro_scale_share),
            mount_heading_rad=beside(configured.imu.mount_heading_rad, bounds.mount_rad),
            mount_pitch_rad=off(bounds.mount_rad),
            mount_roll_rad=off(bounds.mount_rad),
            acceleration_bias_m_s2=(off(most_m_s2), off(most_m_s2), off(most_m_s2)),
        ),
        ultrasonic_offset_m=off(bounds.range_offset_m),
        infrared_offset_m=off(bounds.range_offset_m),
        far_echo_share=unkind.uniform(0, bounds.far_echo_share),
        infrared_glitch_share=unkind.uniform(0, bounds.infrared_glitch_share),
        divider_ratio=near(configured.divider_ratio, bounds.divider_share),
        lidars={name: lidar(own) for name, own in configured.lidars.items()},
    )
