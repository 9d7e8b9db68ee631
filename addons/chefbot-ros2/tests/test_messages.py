"""ROS messages of what the socket tells, checked by hand; no ROS is needed for it."""

import math

import numpy as np
import pytest
from chefbot_ros2.map_messages import MapFromOdom, fixed_transforms, occupancy_grid, path
from chefbot_ros2.topic_events import events_of

from chefbotd.client import Event
from chefbotd.client.models import OdometryData, PathData, RangeData, RangesData, ScanData
from chefbotd.components.maps.map_image import MapImage
from chefbotd.core.events.robot import RangeStatus
from chefbotd.core.geometry import Pose2D

URDF = """<robot name="r">
  <joint name="lidar_joint" type="fixed">
    <parent link="base_link"/><child link="lidar_link"/>
    <origin xyz="0.1 0 0.2" rpy="3.141592653589793 0 1.5707963267948966"/>
  </joint>
  <joint name="left_wheel" type="continuous"><parent link="base_link"/><child link="left_wheel_link"/></joint>
</robot>"""


def event(topic: str, stamp_s: float, data: object) -> Event[object]:
    """As the client hands it over."""
    return Event(topic, 1, stamp_s, 0.0, data)


def test_odometry_keeps_the_upper_triangle_of_its_covariance() -> None:
    """The socket has nine numbers row by row, the daemon six."""
    data = OdometryData(1.0, 2.0, 0.5, 0.2, 0.1, (1.0, 2.0, 3.0, 2.0, 4.0, 5.0, 3.0, 5.0, 6.0))
    (odometry,) = events_of(event("odometry", 7.0, data))
    assert odometry.covariance.row_by_row == data.covariance
    assert (odometry.odom_from_base, odometry.stamp_s) == (Pose2D(1.0, 2.0, 0.5), 7.0)


def test_each_beam_becomes_one_message_though_the_topic_repeats_it() -> None:
    """The event's stamp, rounded to a microsecond, is the newest beam's."""

    def beam(sensor: str, stamp_s: float) -> RangeData:
        return RangeData(sensor, RangeStatus.OK, 1.5, 0.02, 4.0, 0.26, stamp_s)

    data = RangesData((beam("front", 7.0000004), beam("infrared_left", 6.9)))
    (measured,) = events_of(event("ranges", 7.0, data))
    assert (measured.sensor, measured.stamp_s) == ("front", 7.0000004)


@pytest.mark.parametrize("even", [True, False])
def test_a_scan_has_its_bearings_ranges_and_times(even: bool) -> None:
    """Evenly spaced or listed; the last beam is measured at the stamp, the first by the duration before it."""
    bearings = (0.5, -0.1, None) if even else (0.0, None, (500, 400, 300))
    data = ScanData("top", 0.1, 0.0, 0.0, *bearings, (1000, 0, 2500), 0.1)
    (measured,) = events_of(event("scan", 7.0, data))
    assert measured.scan.bearing_rad == pytest.approx(np.array([0.5, 0.4, 0.3]))
    assert measured.scan.range_m == pytest.approx(np.array([1.0, 0.0, 2.5]))
    assert measured.scan.after_s == pytest.approx(np.array([-0.1, -0.05, 0.0]))


def test_what_leads_from_odom_to_map_is_taken_at_the_time_of_the_pose() -> None:
    """Half-way between two poses of odometry, over the turn from pi to -pi; before any, there is nothing."""
    frames = MapFromOdom()
    frames.add_map_pose(0.5, Pose2D(10.5, 5.0, math.pi))
    assert frames.latest is None
    frames.add_odometry(0.0, Pose2D(0.0, 0.0, math.pi - 0.2))
    frames.add_odometry(1.0, Pose2D(1.0, 0.0, 0.2 - math.pi))
    frames.add_map_pose(0.5, Pose2D(10.5, 5.0, math.pi))
    assert frames.latest is not None
    assert (frames.latest.x_m, frames.latest.y_m, frames.latest.heading_rad) == pytest.approx(
        (10.0, 5.0, 0.0)
    )


def test_fixed_joints_become_static_frames_turned_about_x_then_z() -> None:
    """Half a turn about x, then a quarter about z: half a turn about the diagonal. A wheel's joint is none."""
    topic, message = fixed_transforms(URDF, 0)
    (frame,) = message.transforms
    turn = frame.transform.rotation
    assert (topic, frame.header.frame_id, frame.child_frame_id) == ("/tf_static", "base_link", "lidar_link")
    assert (frame.transform.translation.x, frame.transform.translation.z) == (0.1, 0.2)
    assert (turn.x, turn.y, turn.z, turn.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))


def test_a_maps_cells_and_origin_are_as_the_daemon_has_them() -> None:
    """Two columns, one row: unknown and occupied."""
    image = MapImage("flat", 1, 0.0, 0.05, 2, 1, -1.0, 2.0, 0.0, bytes([255, 100]))
    topic, grid = occupancy_grid(image, 3_000_000_001)
    assert (topic, list(grid.data), grid.info.width, grid.info.height) == ("/map", [-1, 100], 2, 1)
    assert (grid.info.origin.position.x, grid.info.origin.position.y) == (-1.0, 2.0)
    assert (grid.header.stamp.sec, grid.header.stamp.nanosec) == (3, 1)


def test_each_point_of_a_path_looks_at_the_next() -> None:
    """East, then north; the last one keeps the direction."""
    _, message = path(PathData((0.0, 1.0, 1.0), (0.0, 0.0, 1.0)), 0)
    headings = [2 * math.atan2(one.pose.orientation.z, one.pose.orientation.w) for one in message.poses]
    assert headings == pytest.approx([0.0, math.pi / 2, math.pi / 2])
    assert {one.header.frame_id for one in message.poses} == {"map"}
