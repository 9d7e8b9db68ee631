"""Makes a map of a ROS 2 bag with odometry and scans, by the SLAM that the robot itself runs.

The bag may be of any robot whose lidar lies level: with `nav_msgs/Odometry`, `sensor_msgs/LaserScan`, and the lidar's
place on the robot by `/tf_static` or `/tf`. Of our own bags the points are read, which are as they were measured.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError

from chefbot_ros2.messages import FLOAT64, NS, POINT_FIELDS, TYPESTORE, pose_in_plane, yaw_rad
from chefbotd.clock import ManualClock
from chefbotd.core.commands import Refused
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.mapping import MapSaved
from chefbotd.core.events.robot import OdometryUpdated
from chefbotd.core.geometry import Pose2D, PoseCovariance, Twist2D
from chefbotd.core.scan import LaserScan
from chefbotd.mapping.parameters import MappingParameters
from chefbotd.worker.messages import packed
from chefbotd.worker.skills.map_files import StoredMaps
from chefbotd.worker.skills.mapping import MappingSkill
from chefbotd.worker.skills.mapping_requests import Finish, MappingSkillParameters, Start

ODOMETRY, SCAN, POINTS = "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2"
TRANSFORMS: Final = "tf2_msgs/msg/TFMessage"
VERSIONS_KEPT: Final = 3
PLANE: Final = (0, 1, 5, 7, 11, 35)
"""Of a covariance over x, y, z and the turns about them: what a PoseCovariance holds."""

GAP: Final = 1.5
"""Of the usual step between two beams: between them are some that saw nothing."""

Measured = OdometryUpdated | ScanMeasured


class CannotMapBagError(Exception):
    """No map can be made of the bag; the message says why."""


class _OnlyFinished(StoredMaps):
    """The folder of maps, in which a daemon may be making one: that one is none of ours."""

    def has_autosave(self) -> bool:
        return False

    def discard_autosave(self) -> None:
        return


def map_bag(bag: Path, folder: Path, name: str, topics: tuple[str, ...] = ()) -> MapSaved:
    """Save the map of a bag as ``name`` in a folder of maps; what it is. ``topics``: of the scans; none: all.

    Raises:
        CannotMapBagError: the bag cannot be read, or lacks something; the map cannot be saved.
    """
    if not bag.exists():
        raise CannotMapBagError(f"{bag}: cannot be read: there is no such file or folder")
    try:
        with AnyReader([bag], default_typestore=TYPESTORE) as reader:
            return map_events(_Bag(reader, topics).events(), folder, name)
    except (AnyReaderError, OSError) as error:
        raise CannotMapBagError(f"{bag}: cannot be read: {error}") from error


def map_events(events: Iterable[Measured], folder: Path, name: str) -> MapSaved:
    """Save the map of what a robot measured, in the order in which it did; raises ``CannotMapBagError``."""
    clock, skill, has_scan = ManualClock(), None, False
    waiting: list[Measured] = []
    lidars: dict[str, None] = {}
    try:
        for event in events:
            if isinstance(event, ScanMeasured):
                lidars[event.lidar] = None
                has_scan = True
            if skill is None:
                waiting.append(event)
                if has_scan and event.stamp_s > waiting[0].stamp_s + LOOK_S:
                    skill = _begun(clock, tuple(lidars), folder)
                    _feed(skill, clock, waiting)
            else:
                _feed(skill, clock, [event])
        if not has_scan:
            raise CannotMapBagError("there is no scan with odometry and with a place on the robot")
        if skill is None:
            skill = _begun(clock, tuple(lidars), folder)
            _feed(skill, clock, waiting)
        return _finished(skill, name)
    except Refused as refused:
        raise CannotMapBagError(str(refused)) from refused


LOOK_S: Final = 2.0
"""Each lidar of the map has been heard by then."""


def _begun(clock: ManualClock, lidars: tuple[str, ...], folder: Path) -> MappingSkill:
    parameters = MappingSkillParameters(
        lidars=lidars, folder=folder, versions_kept=VERSIONS_KEPT, session="bag", mapping=MappingParameters()
    )
    files = _OnlyFinished(folder, VERSIONS_KEPT)
    skill = MappingSkill(parameters.model_dump_json().encode(), clock, files)
    skill.handle(packed(Start()))
    return skill


def _feed(skill: MappingSkill, clock: ManualClock, events: Iterable[Measured]) -> None:
    """The clock is the newest stamp: so whether a bag is old or new makes no difference."""
    for event in events:
        clock.advance(max(0.0, event.stamp_s - clock.now_s()))
        taken = skill.take_scan(event) if isinstance(event, ScanMeasured) else skill.take_odometry(event)
        for _ in taken:  # a pose for each scan, which nobody watches
            pass


def _finished(skill: MappingSkill, name: str) -> MapSaved:
    job: Any = skill.handle(packed(Finish(name)))
    while True:
        try:
            next(job)
        except StopIteration as end:
            saved: MapSaved = end.value
            return saved


class _Bag:
    """What a bag holds for a map. Times begin with the bag, so that seconds keep their nanoseconds."""

    def __init__(self, reader: AnyReader, topics: tuple[str, ...]) -> None:
        self._reader, self._begin_ns = reader, reader.start_time
        self._places = dict(self._transforms())
        kinds = {connection.topic: connection.msgtype for connection in reader.connections}
        own = {topic for topic, kind in kinds.items() if kind == POINTS and topic.startswith("/points/")}
        scans = {
            topic for topic, kind in kinds.items() if kind == SCAN and f"/points/{_short(topic)}" not in own
        }
        self._scans = {topic for topic in own | scans if not topics or topic in topics}
        if missing := sorted(set(topics) - own - scans):
            raise CannotMapBagError(f"the bag has no scans on {', '.join(missing)}")
        if ODOMETRY not in kinds.values():
            raise CannotMapBagError(f"the bag has no {ODOMETRY}")

    def _transforms(self) -> Iterator[tuple[str, tuple[str, Pose2D]]]:
        """The latest of each frame in its parent."""
        connections = [each for each in self._reader.connections if each.msgtype == TRANSFORMS]
        for connection, _, data in self._reader.messages(connections):
            for one in self._reader.deserialize(data, connection.msgtype).transforms:  # type: ignore[attr-defined]
                moved, turned = one.transform.translation, one.transform.rotation
                yield one.child_frame_id, (one.header.frame_id, Pose2D(moved.x, moved.y, yaw_rad(turned)))

    def events(self) -> Iterator[Measured]:
        """Odometry and scans, in the order of the bag."""
        read: Mapping[str, Callable[[str, Any], Iterator[Measured]]] = {
            ODOMETRY: self._odometry,
            SCAN: self._scan,
            POINTS: self._points,
        }
        wanted = [
            connection
            for connection in self._reader.connections
            if connection.msgtype == ODOMETRY or connection.topic in self._scans
        ]
        self._base = ""
        for connection, _, data in self._reader.messages(wanted):
            message = self._reader.deserialize(data, connection.msgtype)
            yield from read[connection.msgtype](connection.topic, message)

    def _odometry(self, topic: str, message: Any) -> Iterator[OdometryUpdated]:
        self._base = message.child_frame_id
        pose, twist, stamp_s = message.pose.pose, message.twist.twist, self._stamp_s(message)
        at = pose_in_plane(pose)
        covariance = PoseCovariance(*[float(message.pose.covariance[index]) for index in PLANE])
        yield OdometryUpdated(stamp_s, stamp_s, at, Twist2D(twist.linear.x, twist.angular.z), covariance)

    def _scan(self, topic: str, message: Any) -> Iterator[ScanMeasured]:
        ranges = np.asarray(message.ranges, dtype=np.float64)
        count = ranges.size
        bearings = message.angle_min + message.angle_increment * np.arange(count, dtype=np.float64)
        duration_s = message.time_increment * max(count - 1, 0)
        after_s = np.linspace(-duration_s, 0.0, count, dtype=np.float64)
        stamp_s = self._stamp_s(message) + duration_s  # it is stamped with its first beam
        ranges = np.where(ranges >= message.range_min, ranges, 0.0)
        yield from self._measured(topic, message, LaserScan(stamp_s, bearings, ranges, after_s))

    def _points(self, topic: str, message: Any) -> Iterator[ScanMeasured]:
        fields = tuple((field.name, field.datatype) for field in message.fields)
        if fields != tuple((name, FLOAT64) for name in POINT_FIELDS):
            raise CannotMapBagError(f"{topic}: expected the fields x, y, z and t as 64-bit floats")
        x, y, _, after_s = np.frombuffer(bytes(message.data), "<f8").reshape(-1, len(POINT_FIELDS)).T
        bearings, ranges = np.arctan2(y, x), np.hypot(x, y)
        steps = np.abs(np.diff(np.unwrap(bearings)))
        gaps = np.flatnonzero(steps > GAP * np.median(steps)) + 1 if steps.size else np.array([], int)
        turn = [np.insert(values, gaps, values[gaps - 1]) for values in (bearings, after_s)]
        scan = LaserScan(self._stamp_s(message), turn[0], np.insert(ranges, gaps, 0.0), turn[1])
        yield from self._measured(topic, message, scan)

    def _measured(self, topic: str, message: Any, scan: LaserScan) -> Iterator[ScanMeasured]:
        """Before the first odometry nobody knows which frame the robot's is."""
        if self._base:
            place = self._place(message.header.frame_id)
            yield ScanMeasured(scan.stamp_s, _short(topic), place, scan)

    def _place(self, frame: str) -> Pose2D:
        """Where a sensor sits on the robot."""
        place, seen = Pose2D(), set[str]()
        while frame != self._base:
            if frame not in self._places or frame in seen:
                raise CannotMapBagError(f"the bag has no transform from {self._base} to {frame}")
            seen.add(frame)
            frame, parent_from_child = self._places[frame]
            place = parent_from_child.compose(place)
        return place

    def _stamp_s(self, message: Any) -> float:
        stamp = message.header.stamp
        return float((stamp.sec * NS + stamp.nanosec - self._begin_ns) / NS)


def _short(topic: str) -> str:
    return topic.rpartition("/")[2]
