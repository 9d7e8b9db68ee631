"""The daemon's events again, from the topics of its socket: so both become the same ROS messages."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from chefbotd.client import Event
from chefbotd.client.models import (
    BatteryData,
    ImuData,
    MapPoseData,
    OdometryData,
    RangesData,
    ScanData,
    WheelsData,
)
from chefbotd.core.events import BatteryMeasured, ImuMeasured, OdometryUpdated, RangeMeasured, WheelsMeasured
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import Pose2D, PoseCovariance, Twist2D
from chefbotd.core.scan import LaserScan

MRAD, MM = 1e-3, 1e-3
MICROSECOND = 1e-6
"""An event's stamp is rounded to it, a beam's own is not."""

UPPER_TRIANGLE = (0, 1, 2, 4, 5, 8)
"""Of a 3x3 matrix, row by row."""


def events_of(event: Event[Any]) -> Iterator[Any]:
    """What a topic's event tells as events of the daemon; none of topics that are not measured."""
    convert = CONVERSIONS.get(event.topic)
    if convert is not None:
        yield from convert(event.data, event.stamp_s)


def pose_of(data: OdometryData | MapPoseData) -> Pose2D:
    """The pose of the base."""
    return Pose2D(data.x_m, data.y_m, data.heading_rad)


def covariance_of(data: OdometryData | MapPoseData) -> PoseCovariance:
    """Its covariance."""
    return PoseCovariance(*[data.covariance[index] for index in UPPER_TRIANGLE])


def _odometry(data: OdometryData, stamp_s: float) -> Iterator[OdometryUpdated]:
    twist = Twist2D(data.linear_m_s, data.angular_rad_s)
    yield OdometryUpdated(stamp_s, stamp_s, pose_of(data), twist, covariance_of(data))


def _wheels(data: WheelsData, stamp_s: float) -> Iterator[WheelsMeasured]:
    travel_rad = (0.0,) * len(data.name)
    yield WheelsMeasured(stamp_s, stamp_s, stamp_s, data.position_rad, travel_rad, data.velocity_rad_s)


def _imu(data: ImuData, stamp_s: float) -> Iterator[ImuMeasured]:
    yield ImuMeasured(
        orientation=data.orientation,
        heading_rad=data.heading_rad,
        angular_velocity_rad_s=data.angular_velocity_rad_s,
        linear_acceleration_m_s2=data.linear_acceleration_m_s2,
        stamp_s=stamp_s,
        arrival_s=stamp_s,
    )


def _ranges(data: RangesData, stamp_s: float) -> Iterator[RangeMeasured]:
    """Those of the newest stamp alone: the topic repeats each sensor's latest."""
    for beam in data.ranges:
        if abs(beam.stamp_s - stamp_s) <= MICROSECOND:
            limits = beam.min_range_m, beam.max_range_m, beam.field_of_view_rad
            yield RangeMeasured(beam.stamp_s, stamp_s, beam.sensor, beam.status, beam.range_m, *limits)


def _battery(data: BatteryData, stamp_s: float) -> Iterator[BatteryMeasured]:
    yield BatteryMeasured(data.voltage_v, data.percentage, data.status, stamp_s=stamp_s, arrival_s=stamp_s)


def _scan(data: ScanData, stamp_s: float) -> Iterator[ScanMeasured]:
    range_m = np.array(data.range_mm, dtype=np.float64) * MM
    count = range_m.size
    if data.bearing_step_rad is not None:
        bearing_rad = data.bearing_start_rad + data.bearing_step_rad * np.arange(count, dtype=np.float64)
    else:
        bearing_rad = np.array(data.bearing_mrad or (), dtype=np.float64) * MRAD
    after_s = np.linspace(-data.duration_s, 0.0, count, dtype=np.float64)
    mount = Pose2D(data.x_m, data.y_m, data.yaw_rad)
    yield ScanMeasured(stamp_s, data.lidar, mount, LaserScan(stamp_s, bearing_rad, range_m, after_s))


CONVERSIONS: Mapping[str, Callable[[Any, float], Iterator[Any]]] = {
    "odometry": _odometry,
    "wheels": _wheels,
    "imu": _imu,
    "ranges": _ranges,
    "battery": _battery,
    "scan": _scan,
}
