"""Dead reckoning: computes the pose in ``odom`` and its covariance from the distances of both sides.

The pose follows the exact arc. The covariance grows with motion only. The travel of each side is uncertain by a
variance proportional to its length (Chong and Kleeman, "Accurate Odometry and Error Modelling for a Mobile Robot",
ICRA 1997). Turning scrubs the tyres, which adds a variance proportional to the angle (the rotational noise of Thrun,
Burgard and Fox, "Probabilistic Robotics", 5.4).
"""

import math
from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import Any, ClassVar, Final, TypeAlias

from pydantic import Field

from chefbotd.core.geometry import CERTAIN, ORIGIN, STANDING, Pose2D, PoseCovariance, Twist2D, wrap_angle
from chefbotd.core.parameters import Parameters, section
from chefbotd.core.record import Record

Error: TypeAlias = tuple[float, float, float, float]
"""The variance of an error, and how far x (m), y (m) and the heading (rad) move per unit of it."""

BIAS_WALK_RAD_S_PER_ROOT_S: Final = 2e-5
"""How fast the bias of a gyroscope changes, as a random walk; assumed."""

HEADING_WALK_RAD_PER_ROOT_S: Final = 1e-4
"""How fast a heading that the board sends goes astray, as a random walk; assumed."""

SLIP_RAD: Final = 0.031
"""Wheels and IMU must differ by this in a quarter of a second for a wheel to slip; assumed."""

COMMAND_TIME_CONSTANT_S: Final = 0.1
"""How fast a wheel follows a command, where odometry is made of commands; assumed."""

COMMAND_SIGMA: Final = 0.1
"""The share by which a wheel may be off a command there; assumed."""


class FusionParameters(Parameters):
    """``[odometry.fusion]``: what calibration leaves uncertain, and what disturbs the IMU; each one sigma.

    The first four are shares: of the wheels' size, of left to right size, of the track, and of the gyroscope's scale. A
    robot that was not calibrated has the defaults. ``heading_noise_rad`` is that of a board that sends its orientation
    with two decimals. The noise of the gyroscope is that of an MPU-6050 (0.005 deg/s/sqrt(Hz)), ten times over for
    vibration, which is assumed. ``gyro_bias_rad_s`` and ``heading_drift_rad_s`` are how uncertain the two are at
    start.
    """

    retired: ClassVar[Mapping[str, Any]] = {
        "bias_walk_rad_s_per_root_s": BIAS_WALK_RAD_S_PER_ROOT_S,
        "heading_walk_rad_per_root_s": HEADING_WALK_RAD_PER_ROOT_S,
        "slip_rad": SLIP_RAD,
    }

    size_sigma: float = Field(default=0.005, ge=0, le=0.2)
    """How uncertain the size of the wheels is, as a share."""
    ratio_sigma: float = Field(default=0.003, ge=0, le=0.2)
    """How uncertain the size of the left wheels is against the right ones, as a share."""
    track_sigma: float = Field(default=0.01, ge=0, le=1)
    """How uncertain the track is, as a share."""
    gyro_scale_sigma: float = Field(default=0.005, ge=0, le=0.2)
    """How uncertain the gyroscope's scale is, as a share."""
    heading_noise_rad: float = Field(default=0.0075, gt=0, le=1)
    """The noise of a heading that the board sends; the default is that of two decimals."""
    gyro_noise_rad_per_root_s: float = Field(default=1e-3, ge=0, le=1)
    """The noise of the gyroscope, in radians for the root of a second."""
    gyro_bias_rad_s: float = Field(default=0.02, ge=0, le=1)
    """How uncertain the gyroscope's bias is at the start."""
    heading_drift_rad_s: float = Field(default=2e-4, ge=0, le=1)
    """How uncertain the drift of the board's heading is at the start."""
    project_tilt: bool = False
    """Take the travel's share in the plane, by the IMU's orientation; two decimals are too coarse for it."""
    max_acceleration_m_s2: float | None = Field(default=None, gt=0, le=1000)
    """Refuse up to five travels in a row that would need more; left out, as encoders are checked before."""


class OdometrySource(StrEnum):
    """What odometry is made of: the wheels, the wheels and the IMU, or the speeds that the wheels were commanded."""

    WHEELS = "wheels"
    WHEELS_IMU = "wheels_imu"
    COMMANDS = "commands"


class OdometryParameters(Parameters):
    """The source of odometry, and how fast certainty is lost.

    The defaults are one sigma of a centimetre per side after a metre, and of a degree after a turned radian.
    ``fusion`` is for the source ``wheels_imu``.
    """

    retired: ClassVar[Mapping[str, Any]] = {
        "command_time_constant_s": COMMAND_TIME_CONSTANT_S,
        "command_sigma": COMMAND_SIGMA,
    }

    source: OdometrySource = OdometrySource.WHEELS
    """What odometry is made of: the wheels, the wheels and the IMU, or the speeds that were commanded."""
    travel_variance_m2_per_m: float = Field(default=1e-4, ge=0, le=1)
    """How fast the travelled way becomes uncertain."""
    turn_variance_rad2_per_rad: float = Field(default=3e-4, ge=0, le=1)
    """How fast the heading becomes uncertain in a turn."""
    fusion: FusionParameters = section()


class OdometryState(Record, frozen=True):
    """The pose, the twist in the base frame, and the covariance of (x, y, heading) in ``odom``."""

    odom_from_base: Pose2D
    twist: Twist2D
    covariance: PoseCovariance


START = OdometryState(ORIGIN, STANDING, CERTAIN)


def set_pose(state: OdometryState, pose: Pose2D) -> OdometryState:
    """Set the pose: it becomes certain, its heading is wrapped to (-pi, pi], and the twist stays."""
    wrapped = Pose2D(pose.x_m, pose.y_m, wrap_angle(pose.heading_rad))
    return OdometryState(wrapped, state.twist, CERTAIN)


def integrate(
    params: OdometryParameters,
    track_width_m: float,
    state: OdometryState,
    left_m: float,
    right_m: float,
    twist: Twist2D,
) -> OdometryState:
    """The state after the sides have rolled this far along an arc; ``twist`` is the present motion.

    Written in one piece, since it runs for every frame: ``tests/plain`` has it in several.
    """
    if left_m == 0 == right_m:
        return OdometryState(state.odom_from_base, twist, state.covariance)
    before = state.odom_from_base
    x_m, y_m, heading_rad = before.x_m, before.y_m, before.heading_rad
    turned_rad, travel_m = (right_m - left_m) / track_width_m, (left_m + right_m) / 2
    half_rad = turned_rad / 2
    ratio = math.sin(half_rad) / half_rad if half_rad else 1.0  # of the chord to the arc
    chord_m = travel_m * ratio  # it lies half of the turn off the heading
    ahead_m, aside_m = chord_m * math.cos(half_rad), chord_m * math.sin(half_rad)
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    pose = Pose2D(
        x_m + cos * ahead_m - sin * aside_m,
        y_m + sin * ahead_m + cos * aside_m,
        wrap_angle(heading_rad + turned_rad),
    )
    # How the end answers to a little more left travel, right travel, and turn by scrubbing.
    cos, sin = math.cos(heading_rad + half_rad), math.sin(heading_rad + half_rad)
    bend_m = travel_m * _sinc_slope(half_rad) / 2
    swing_m = travel_m * ratio / 2
    forward_x, forward_y = ratio * cos / 2, ratio * sin / 2
    turn_x, turn_y = bend_m * cos - swing_m * sin, bend_m * sin + swing_m * cos
    per_m, travel_variance = 1 / track_width_m, params.travel_variance_m2_per_m
    aside_x, aside_y = turn_x * per_m, turn_y * per_m
    errors = (
        (travel_variance * abs(left_m), forward_x - aside_x, forward_y - aside_y, -per_m),
        (travel_variance * abs(right_m), forward_x + aside_x, forward_y + aside_y, per_m),
        (params.turn_variance_rad2_per_rad * abs(turned_rad), turn_x, turn_y, 1.0),
    )
    return OdometryState(pose, twist, _carry(state.covariance, pose.x_m - x_m, pose.y_m - y_m, errors))


def _carry(
    before: PoseCovariance, moved_x_m: float, moved_y_m: float, errors: Iterable[Error]
) -> PoseCovariance:
    """The covariance at the start as it stands at the end: an error of heading swings the way between.

    ``F P F^T`` with the motion's Jacobian F = [[1, 0, -moved_y], [0, 1, moved_x], [0, 0, 1]], and ``v r r^T`` more for
    each independent error of variance v, which moves the pose by the response r per unit.
    """
    xx, xy, xh, yy, yh, hh = before.xx, before.xy, before.xh, before.yy, before.yh, before.hh
    swung_xh, swung_yh = xh - moved_y_m * hh, yh + moved_x_m * hh
    xx, xy = xx - moved_y_m * (xh + swung_xh), xy - moved_y_m * yh + moved_x_m * swung_xh
    yy, xh, yh = yy + moved_x_m * (yh + swung_yh), swung_xh, swung_yh
    for variance, x, y, heading in errors:
        of_x, of_y, of_heading = variance * x, variance * y, variance * heading
        xx += of_x * x
        xy += of_x * y
        xh += of_x * heading
        yy += of_y * y
        yh += of_y * heading
        hh += of_heading * heading
    return PoseCovariance(xx, xy, xh, yy, yh, hh)


def _sinc(angle_rad: float) -> float:
    """``sin(x) / x``, chord to arc: accurate everywhere but at zero, where its limit is 1."""
    return math.sin(angle_rad) / angle_rad if angle_rad else 1.0


def _sinc_slope(angle_rad: float) -> float:
    """The derivative of ``sin(x) / x``; near zero by its series, where the closed form cancels."""
    if abs(angle_rad) < 1e-3:
        return -angle_rad / 3
    return (math.cos(angle_rad) - _sinc(angle_rad)) / angle_rad
