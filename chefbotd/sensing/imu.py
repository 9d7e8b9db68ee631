"""Inertial measurement unit (MPU-6050): quaternion or raw counts to SI, in the robot's own axes."""

import math
from functools import cached_property

from pydantic import Field

from chefbotd.core.events import ImuMeasured, InertialCounted, OrientationReported
from chefbotd.core.parameters import Parameters

STANDARD_GRAVITY_M_S2 = 9.80665


class ImuParameters(Parameters):
    """How the sensor is mounted and scaled; the default scales are those of ±2 g and ±250 °/s.

    ``mount_heading_rad`` is where the sensor's x axis points in ``base_footprint``, CCW positive. Its z axis is up, or
    down where it is ``upside_down``: turned about its x axis. Only the robot's description needs ``mount_z_m``, the
    height above the floor.

    A calibration finds the rest. The gyroscope shows ``gyro_scale`` times a turn, and about z ``gyro_bias_rad_s`` at
    rest; rates are corrected for both. A heading that the board sums up itself is reported as it is; odometry divides
    its changes by the scale. Readings come ``lag_s`` after what they show, by their stamps; odometry takes it off.
    """

    mount_heading_rad: float = Field(default=0.0, ge=-math.pi, le=math.pi)
    upside_down: bool = False
    """Its z axis points down."""
    mount_z_m: float | None = Field(default=None, ge=0, le=5)
    """Its height above the floor, for the description alone."""
    accel_counts_per_g: float = Field(default=16384.0, gt=0)
    """What the board's raw reading of the accelerometer counts for one g."""
    gyro_counts_per_deg_s: float = Field(default=131.0, gt=0)
    """What the board's raw reading of the gyroscope counts for one degree a second."""
    gyro_scale: float = Field(default=1.0, ge=0.5, le=2)
    """What the gyroscope shows of a turn, as a factor; it is corrected for."""
    gyro_bias_rad_s: float = Field(default=0.0, ge=-1, le=1)
    """The rate about z that the gyroscope shows at rest; it is corrected for."""
    lag_s: float = Field(default=0.0, ge=-0.2, le=2)
    """How late its readings are, by their stamps; odometry takes it off."""

    @cached_property
    def half_mount(self) -> tuple[float, float]:
        """Cosine and sine of half the mount's heading, turned back."""
        return math.cos(self.mount_heading_rad / 2), -math.sin(self.mount_heading_rad / 2)


def from_quaternion(params: ImuParameters, reported: OrientationReported) -> ImuMeasured:
    """The robot's orientation as a unit quaternion, and its heading (yaw) in (-pi, pi].

    Raises:
        ValueError: all four are zero, which is no rotation at all.
    """
    x, y, z, w = reported.x, reported.y, reported.z, reported.w
    norm = math.hypot(x, y, z, w)
    if norm == 0:
        raise ValueError("the quaternion is zero")
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    if params.upside_down:
        x, y, z, w = _turned_over(x, y, z, w)
    x, y, z, w = _unmount(params, x, y, z, w)
    heading_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return ImuMeasured(
        stamp_s=reported.stamp_s,
        arrival_s=reported.arrival_s,
        orientation=(x, y, z, w),
        heading_rad=heading_rad,
    )


def from_counts(params: ImuParameters, counted: InertialCounted) -> ImuMeasured:
    """Acceleration in m/s² (at rest +g upwards) and angular rate in rad/s, in the robot's axes."""
    rad_s_per_count = math.radians(1 / params.gyro_counts_per_deg_s) / params.gyro_scale
    m_s2_per_count = STANDARD_GRAVITY_M_S2 / params.accel_counts_per_g
    x_rad_s, y_rad_s, z_rad_s = _to_base(params, counted.angular_rate, rad_s_per_count)
    return ImuMeasured(
        stamp_s=counted.stamp_s,
        arrival_s=counted.arrival_s,
        angular_velocity_rad_s=(x_rad_s, y_rad_s, z_rad_s - params.gyro_bias_rad_s / params.gyro_scale),
        linear_acceleration_m_s2=_to_base(params, counted.acceleration, m_s2_per_count),
    )


def _turned_over(x: float, y: float, z: float, w: float) -> tuple[float, float, float, float]:
    """The orientation of a sensor beside this one that is not upside down.

    One that knows where up is says that it lies on its back. One that takes its own z axis for up is right about
    everything but the world: that is turned over as well.
    """
    if 1 - 2 * (x * x + y * y) < 0:
        return -w, -z, y, x
    return x, -y, -z, w


def _unmount(
    params: ImuParameters, x: float, y: float, z: float, w: float
) -> tuple[float, float, float, float]:
    """``world_from_sensor`` times ``sensor_from_base``, which turns back by the mount's heading about z."""
    cos, sin = params.half_mount
    return x * cos + y * sin, y * cos - x * sin, z * cos + w * sin, w * cos - z * sin


def _to_base(params: ImuParameters, counts: tuple[int, int, int], scale: float) -> tuple[float, float, float]:
    cos, sin = math.cos(params.mount_heading_rad), math.sin(params.mount_heading_rad)
    x, y, z = (count * scale for count in counts)
    if params.upside_down:
        y, z = -y, -z
    return x * cos - y * sin, x * sin + y * cos, z
