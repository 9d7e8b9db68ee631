"""ROS 2 messages of what the robot knows of its surroundings and of itself: maps, paths, and its own frames."""

import math
from collections import deque
from typing import Any
from xml.etree import ElementTree

import numpy as np

from chefbot_ros2.messages import (
    MAP,
    NS,
    Message,
    TFMessage,
    Time,
    Transform,
    TransformStamped,
    Vector3,
    header,
    pose_message,
    ros_type,
)
from chefbotd.client.models import PathData
from chefbotd.components.maps.map_image import MapImage
from chefbotd.core.geometry import Pose2D, wrap_angle

OccupancyGrid, MapMetaData = ros_type("nav_msgs/OccupancyGrid"), ros_type("nav_msgs/MapMetaData")
Path, PoseStamped = ros_type("nav_msgs/Path"), ros_type("geometry_msgs/PoseStamped")
Quaternion, String = ros_type("geometry_msgs/Quaternion"), ros_type("std_msgs/String")

REMEMBERED_POSES = 200


def occupancy_grid(image: MapImage, stamp_ns: int) -> Message:
    """A map: -1 unknown, 0 free, 100 occupied, the lowest row first, as nav_msgs/OccupancyGrid has it too."""
    origin = pose_message(Pose2D(image.x_m, image.y_m, image.heading_rad))
    loaded = Time(stamp_ns // NS, stamp_ns % NS)
    about = MapMetaData(loaded, image.resolution_m, image.columns, image.rows, origin)
    return "/map", OccupancyGrid(header(stamp_ns, MAP), about, np.frombuffer(image.cells, np.int8))


def path(data: PathData, stamp_ns: int) -> Message:
    """The path that the robot follows; each point is turned towards the next."""
    points = list(zip(data.x_m, data.y_m, strict=True))
    poses, heading_rad = [], 0.0
    for index, (x_m, y_m) in enumerate(points):
        if index + 1 < len(points):
            heading_rad = math.atan2(points[index + 1][1] - y_m, points[index + 1][0] - x_m)
        poses.append(PoseStamped(header(stamp_ns, MAP), pose_message(Pose2D(x_m, y_m, heading_rad))))
    return "/plan", Path(header(stamp_ns, MAP), poses)


def fixed_transforms(urdf: str, stamp_ns: int) -> Message:
    """The fixed joints of the robot's description."""
    robot = ElementTree.fromstring(urdf)  # noqa: S314 - the daemon's own document
    joints = [joint for joint in robot.iter("joint") if joint.get("type") == "fixed"]
    return "/tf_static", TFMessage([_fixed_transform(joint, stamp_ns) for joint in joints])


def _fixed_transform(joint: ElementTree.Element, stamp_ns: int) -> Any:
    def link(name: str) -> str:
        element = joint.find(name)
        return "" if element is None else element.get("link", "")

    origin = joint.find("origin")
    texts = {} if origin is None else origin.attrib
    xyz, rpy = ([float(word) for word in texts.get(name, "0 0 0").split()] for name in ("xyz", "rpy"))
    placed = Transform(Vector3(*xyz), quaternion_of(*rpy))
    return TransformStamped(header(stamp_ns, link("parent")), link("child"), placed)


def quaternion_of(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Any:
    """URDF's fixed-axis angles: about x, then y, then z."""
    cr, cp, cy = (math.cos(angle / 2) for angle in (roll_rad, pitch_rad, yaw_rad))
    sr, sp, sy = (math.sin(angle / 2) for angle in (roll_rad, pitch_rad, yaw_rad))
    return Quaternion(
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


class MapFromOdom:
    """The transform from ``odom`` to ``map``: the pose in the map against odometry at the same time."""

    def __init__(self) -> None:
        self._poses: deque[tuple[float, Pose2D]] = deque(maxlen=REMEMBERED_POSES)
        self.latest: Pose2D | None = None

    def add_odometry(self, stamp_s: float, odom_from_base: Pose2D) -> None:
        """Remember where odometry was, for some seconds."""
        self._poses.append((stamp_s, odom_from_base))

    def add_map_pose(self, stamp_s: float, map_from_base: Pose2D) -> None:
        """The pose in the map at a time; without odometry nothing follows from it."""
        odom_from_base = self._odometry_at(stamp_s)
        if odom_from_base is not None:
            self.latest = map_from_base.compose(odom_from_base.inverse())

    def _odometry_at(self, stamp_s: float) -> Pose2D | None:
        before = after = None
        for pose in self._poses:
            if pose[0] > stamp_s:
                after = pose
                break
            before = pose
        if before is None or after is None:
            nearest = before or after
            return None if nearest is None else nearest[1]
        share = (stamp_s - before[0]) / (after[0] - before[0])
        first, second = before[1], after[1]
        turned_rad = wrap_angle(second.heading_rad - first.heading_rad)
        return Pose2D(
            first.x_m + share * (second.x_m - first.x_m),
            first.y_m + share * (second.y_m - first.y_m),
            wrap_angle(first.heading_rad + share * turned_rad),
        )
