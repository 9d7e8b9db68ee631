"""ROS 2 messages of chefbotd's events. Frames follow REP-105, units and axes REP-103, which are chefbotd's own."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from chefbotd.core.events import BatteryMeasured, ImuMeasured, OdometryUpdated, RangeMeasured, WheelsMeasured
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import RangeStatus
from chefbotd.core.geometry import Pose2D, PoseCovariance

TYPESTORE = get_typestore(Stores.ROS2_KILTED)
"""Of Jazzy and Kilted, whose messages are the same here. Humble's differ in one: its Range has no ``variance``."""

NS = 1_000_000_000
MAP, ODOM, BASE = "map", "odom", "base_footprint"
PLANE = np.array([0, 1, 5, 6, 7, 11, 30, 31, 35])
"""The plane's part of a covariance of six by six, row by row."""

NOT_MEASURED = -1.0
"""In the first element of a covariance: this quantity is not measured (sensor_msgs/Imu)."""

VARIANCE_UNKNOWN = 0.0
"""sensor_msgs/Range."""

FLOAT64 = 8
"""sensor_msgs/PointField."""

POINT_FIELDS = ("x", "y", "z", "t")
ULTRASOUND, INFRARED = 0, 1
SMALLEST_INCREMENT_RAD = 1e-6

LATCHED_TOPICS = frozenset({"/map", "/plan", "/robot_description", "/tf_static"})
"""Who subscribes later gets the last message too."""

Message = tuple[str, Any]
"""A topic and its message."""


def ros_type(name: str) -> Any:
    """A message's class by its name, such as ``nav_msgs/Odometry``."""
    package, _, short = name.partition("/")
    return TYPESTORE.types[f"{package}/msg/{short}"]


Time, Header = ros_type("builtin_interfaces/Time"), ros_type("std_msgs/Header")
Vector3, Point, Quaternion = (
    ros_type(f"geometry_msgs/{name}") for name in ("Vector3", "Point", "Quaternion")
)
Pose, PoseWithCovariance = ros_type("geometry_msgs/Pose"), ros_type("geometry_msgs/PoseWithCovariance")
Twist, TwistWithCovariance = ros_type("geometry_msgs/Twist"), ros_type("geometry_msgs/TwistWithCovariance")
Transform, TransformStamped = ros_type("geometry_msgs/Transform"), ros_type("geometry_msgs/TransformStamped")
TFMessage, Odometry = ros_type("tf2_msgs/TFMessage"), ros_type("nav_msgs/Odometry")
Imu, Range, JointState = (ros_type(f"sensor_msgs/{name}") for name in ("Imu", "Range", "JointState"))
BatteryState, LaserScan = ros_type("sensor_msgs/BatteryState"), ros_type("sensor_msgs/LaserScan")
PointCloud2, PointField = ros_type("sensor_msgs/PointCloud2"), ros_type("sensor_msgs/PointField")


def messages(
    event: Any,
    clock_offset_ns: int,
    wheel_names: Sequence[str],
    is_wanted: Callable[[str], bool] = lambda topic: True,
) -> Iterator[Message]:
    """The messages of an event on the topics that are wanted; none of most events.

    The offset leads from the daemon's clock to 1970.
    """
    for topic_of, convert in CONVERSIONS.get(type(event), ()):
        topic = topic_of(event)
        if is_wanted(topic):
            message = convert(event, stamped(event.stamp_s, clock_offset_ns), wheel_names)
            if message is not None:
                yield topic, message


def stamped(stamp_s: float, clock_offset_ns: int) -> int:
    """A time of the daemon's clock as nanoseconds since 1970."""
    return clock_offset_ns + round(stamp_s * NS)


def mount(event: ScanMeasured, stamp_ns: int) -> Message:
    """Where the lidar sits on the robot."""
    return "/tf_static", TFMessage([transform(stamp_ns, BASE, frame_of(event.lidar), event.base_from_lidar)])


def transform(stamp_ns: int, parent: str, child: str, parent_from_child: Pose2D) -> Any:
    """Where one frame stands in another."""
    translation = Vector3(parent_from_child.x_m, parent_from_child.y_m, 0.0)
    turn = Transform(translation, quaternion(parent_from_child.heading_rad))
    return TransformStamped(header(stamp_ns, parent), child, turn)


def pose_message(pose: Pose2D) -> Any:
    """A pose in the plane."""
    return Pose(Point(pose.x_m, pose.y_m, 0.0), quaternion(pose.heading_rad))


def frame_of(sensor: str) -> str:
    """The frame of a sensor."""
    return f"{sensor}_link"


def header(stamp_ns: int, frame: str) -> Any:
    """A message's header."""
    return Header(Time(stamp_ns // NS, stamp_ns % NS), frame)


def quaternion(heading_rad: float) -> Any:
    """A turn about z."""
    return Quaternion(0.0, 0.0, math.sin(heading_rad / 2), math.cos(heading_rad / 2))


def pose_in_plane(pose: Any) -> Pose2D:
    """The x, y and turn about z of a geometry_msgs/Pose, whoever has made its class."""
    return Pose2D(pose.position.x, pose.position.y, yaw_rad(pose.orientation))


def yaw_rad(q: Any) -> float:
    """The turn about z of a geometry_msgs/Quaternion."""
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def _odometry(event: OdometryUpdated, stamp_ns: int, wheel_names: Sequence[str]) -> Any:
    twist = event.twist
    moves = Twist(Vector3(twist.linear_m_s, 0.0, 0.0), Vector3(0.0, 0.0, twist.angular_rad_s))
    return Odometry(
        header(stamp_ns, ODOM),
        BASE,
        PoseWithCovariance(pose_message(event.odom_from_base), _covariance(event.covariance)),
        TwistWithCovariance(moves, np.zeros(36)),
    )


def _base(event: OdometryUpdated, stamp_ns: int, wheel_names: Sequence[str]) -> Any:
    return TFMessage([transform(stamp_ns, ODOM, BASE, event.odom_from_base)])


def _covariance(covariance: PoseCovariance) -> Any:
    """Six by six over x, y, z and the turns about them; the plane's three are known, and the others do not change."""
    matrix = np.zeros(36)
    matrix[PLANE] = covariance.row_by_row
    return matrix


def _wheels(event: WheelsMeasured, stamp_ns: int, wheel_names: Sequence[str]) -> Any:
    names = list(wheel_names) or [f"wheel_{index}" for index in range(len(event.position_rad))]
    values = np.array(event.position_rad), np.array(event.velocity_rad_s), np.array([])
    return JointState(header(stamp_ns, ""), names, *values)


def _imu(event: ImuMeasured, stamp_ns: int, wheel_names: Sequence[str]) -> Any:
    orientation = event.orientation or (0.0, 0.0, 0.0, 1.0)
    measured = event.orientation, event.angular_velocity_rad_s, event.linear_acceleration_m_s2
    unknown = [
        np.zeros(9) if value is not None else np.array([NOT_MEASURED, *[0.0] * 8]) for value in measured
    ]
    turn, acceleration = (Vector3(*(value or (0.0, 0.0, 0.0))) for value in measured[1:])
    return Imu(
        header(stamp_ns, BASE),
        Quaternion(*orientation),
        unknown[0],
        turn,
        unknown[1],
        acceleration,
        unknown[2],
    )


def _range(event: RangeMeasured, stamp_ns: int, wheel_names: Sequence[str]) -> Any:
    measured_m = math.inf if event.range_m is None else event.range_m
    if event.status is RangeStatus.TOO_NEAR:
        measured_m = -math.inf  # REP-117: nearer than the sensor measures
    kind = INFRARED if "infrared" in event.sensor else ULTRASOUND
    limits = event.field_of_view_rad, event.min_range_m, event.max_range_m
    return Range(header(stamp_ns, frame_of(event.sensor)), kind, *limits, measured_m, VARIANCE_UNKNOWN)


def _battery(event: BatteryMeasured, stamp_ns: int, wheel_names: Sequence[str]) -> Any:
    nan = math.nan
    unknown = 0
    return BatteryState(
        header=header(stamp_ns, ""),
        voltage=event.voltage_v,
        temperature=nan,
        current=nan,
        charge=nan,
        capacity=nan,
        design_capacity=nan,
        percentage=event.percentage / 100,
        power_supply_status=unknown,
        power_supply_health=unknown,
        power_supply_technology=unknown,
        present=True,
        cell_voltage=np.array([], dtype=np.float32),
        cell_temperature=np.array([], dtype=np.float32),
        location="",
        serial_number="",
    )


def _is_reading(event: ScanMeasured) -> Any:
    return np.isfinite(event.scan.range_m) & (event.scan.range_m > 0)


def _points(event: ScanMeasured, stamp_ns: int, wheel_names: Sequence[str]) -> Any:
    scan, is_reading = event.scan, _is_reading(event)
    bearing, distance = scan.bearing_rad[is_reading], scan.range_m[is_reading]
    columns = distance * np.cos(bearing), distance * np.sin(bearing), np.zeros_like(distance)
    points = np.stack([*columns, scan.after_s[is_reading]], axis=1).astype("<f8")
    count, step = len(points), 8 * len(POINT_FIELDS)
    fields = [PointField(name, 8 * index, FLOAT64, 1) for index, name in enumerate(POINT_FIELDS)]
    data = np.frombuffer(points.tobytes(), dtype=np.uint8)
    at = header(stamp_ns, frame_of(event.lidar))
    return PointCloud2(at, 1, count, fields, False, step, step * count, data, True)


def _laser_scan(event: ScanMeasured, stamp_ns: int, wheel_names: Sequence[str]) -> Any:
    """The turn on evenly spaced bearings from the least to the greatest; a bearing without a reading is infinite.

    It is stamped with the first beam, as sensor_msgs/LaserScan asks for. A turn of one beam is none.
    """
    scan, count, is_reading = event.scan, event.scan.bearing_rad.size, _is_reading(event)
    if count < 2:
        return None
    low, high = float(scan.bearing_rad.min()), float(scan.bearing_rad.max())
    increment = max((high - low) / (count - 1), SMALLEST_INCREMENT_RAD)
    ranges = np.full(count, np.inf, dtype=np.float32)
    places = np.clip(np.rint((scan.bearing_rad[is_reading] - low) / increment).astype(int), 0, count - 1)
    np.minimum.at(ranges, places, scan.range_m[is_reading].astype(np.float32))
    time_s = float(np.ptp(scan.after_s))
    finite = ranges[np.isfinite(ranges)]
    # others take a reading at range_max for none, so the limit is just beyond the farthest one
    limits = (0.0, float(np.nextafter(finite.max(), np.float32(np.inf))) if finite.size else 0.0)
    first_ns = stamp_ns + round(float(scan.after_s.min()) * NS)
    return LaserScan(
        header(first_ns, frame_of(event.lidar)),
        low,
        low + increment * (count - 1),
        increment,
        time_s / (count - 1),
        time_s,
        *limits,
        ranges,
        np.array([], dtype=np.float32),
    )


Convert = Callable[[Any, int, Sequence[str]], Any]
CONVERSIONS: Mapping[type[Any], tuple[tuple[Callable[[Any], str], Convert], ...]] = {
    OdometryUpdated: ((lambda event: "/odom", _odometry), (lambda event: "/tf", _base)),
    WheelsMeasured: ((lambda event: "/joint_states", _wheels),),
    ImuMeasured: ((lambda event: "/imu", _imu),),
    RangeMeasured: ((lambda event: f"/ranges/{event.sensor}", _range),),
    BatteryMeasured: ((lambda event: "/battery", _battery),),
    ScanMeasured: (
        (lambda event: f"/scan/{event.lidar}", _laser_scan),
        (lambda event: f"/points/{event.lidar}", _points),
    ),
}
"""For each event its topics, and what makes the message; None: this one has none."""
