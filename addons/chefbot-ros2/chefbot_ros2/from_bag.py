"""Makes a map of a ROS 2 bag with odometry and scans, by the SLAM that the robot itself runs.

The bag may be of any robot whose lidar lies level, upright or upside down: with `nav_msgs/Odometry`,
`sensor_msgs/LaserScan`, and the lidar's place on the robot by `/tf_static` or `/tf`, or as the caller says. Of our own
bags the points are read, which are as they were measured.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from rosbags.highlevel import AnyReader

from chefbot_ros2.bag_frames import CannotPlaceError, Frames, Mount, plain
from chefbot_ros2.bag_scans import no_return_m, scan_of
from chefbot_ros2.messages import FLOAT64, NS, POINT_FIELDS, TYPESTORE, pose_in_plane
from chefbotd.clock import ManualClock
from chefbotd.components.mapping.algorithms.parameters import MappingParameters
from chefbotd.components.mapping.algorithms.state import SlamMode
from chefbotd.components.mapping.map_files import StoredMaps
from chefbotd.components.mapping.skill import MappingSkill
from chefbotd.components.mapping.skill_requests import Finish, MappingSkillParameters, Start
from chefbotd.components.maps.events import MapSaved
from chefbotd.components.worker.messages import pack_body
from chefbotd.core.commands import Refused
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import MapPoseUpdated, OdometryUpdated
from chefbotd.core.geometry import PoseCovariance, Twist2D
from chefbotd.core.record import Record
from chefbotd.core.scan import LaserScan

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


class MappedBag(Record, frozen=True):
    """The saved map, and what makes one doubt it, for people (empty: nothing)."""

    saved: MapSaved
    doubt: str = ""


def map_bag(
    bag: Path, folder: Path, name: str, topics: tuple[str, ...] = (), mount: Mount | None = None
) -> MappedBag:
    """Save the map of a bag as ``name`` in a folder of maps. ``topics``: of the scans; none: all.

    ``mount`` is where the lidar sits, in place of what the bag says.

    Raises:
        CannotMapBagError: the bag cannot be read, or lacks something; the map cannot be saved.
    """
    if not bag.exists():
        raise CannotMapBagError(f"{bag}: cannot be read: there is no such file or folder")
    try:
        with AnyReader([bag], default_typestore=TYPESTORE) as reader:
            return map_events(_Bag(reader, topics, mount).events(), folder, name)
    except CannotMapBagError:
        raise
    except Exception as error:  # a stranger's file: the reader's library raises whatever comes of it
        raise CannotMapBagError(f"{bag}: cannot be read: {type(error).__name__}: {error}") from error


def map_events(events: Iterable[Measured], folder: Path, name: str) -> MappedBag:
    """Save the map of what a robot measured, in the order in which it did; raises ``CannotMapBagError``."""
    fit = _Fit()
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
                    _feed(skill, clock, waiting, fit)
            else:
                _feed(skill, clock, [event], fit)
        if not has_scan:
            raise CannotMapBagError("there is no scan with odometry and with a place on the robot")
        if skill is None:
            skill = _begun(clock, tuple(lidars), folder)
            _feed(skill, clock, waiting, fit)
        return MappedBag(_finished(skill, name), fit.doubt)
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
    skill.handle(pack_body(Start()))
    return skill


class _Fit:
    """How well the scans fitted the map that they made."""

    def __init__(self) -> None:
        self._fits: list[float] = []
        self._fitting = 0

    def add_pose(self, pose: MapPoseUpdated) -> None:
        """The pose that SLAM found for a scan."""
        self._fits.append(pose.fit)
        self._fitting += pose.state == str(SlamMode.MAPPING)

    @property
    def doubt(self) -> str:
        """Why the map may be wrong, for people; empty where it fits."""
        count = len(self._fits)
        if not count:
            return ""
        median, share = float(np.median(self._fits)), self._fitting / count
        if share >= LEAST_FITTING and median >= LEAST_FIT:
            return ""
        return (
            f"the map may be wrong: {share:.0%} of {count} scans agree with odometry and with the map, and half of "
            f"them fit to {median:.0%} or less (a good bag: over {LEAST_FITTING:.0%} and {LEAST_FIT:.0%}). Look at it "
            "before you use it. Is the lidar's place right (--mount, --upside-down)?"
        )


LEAST_FITTING: Final = 0.9
LEAST_FIT: Final = 0.9
"""Of a good bag of a simulated lidar all scans agree; with its mirror image a fifth count as slipping wheels."""


def _feed(skill: MappingSkill, clock: ManualClock, events: Iterable[Measured], fit: _Fit) -> None:
    """The clock is the newest stamp: so whether a bag is old or new makes no difference."""
    for event in events:
        clock.advance(max(0.0, event.stamp_s - clock.now_s()))
        taken = skill.take_scan(event) if isinstance(event, ScanMeasured) else skill.take_odometry(event)
        for told in taken:
            if isinstance(told, MapPoseUpdated):
                fit.add_pose(told)


def _finished(skill: MappingSkill, name: str) -> MapSaved:
    job: Any = skill.handle(pack_body(Finish(name)))
    while True:
        try:
            next(job)
        except StopIteration as end:
            saved: MapSaved = end.value
            return saved


class _Bag:
    """What a bag holds for a map. Times begin with the bag, so that seconds keep their nanoseconds."""

    def __init__(self, reader: AnyReader, topics: tuple[str, ...], mount: Mount | None) -> None:
        self._reader, self._begin_ns, self._given = reader, reader.start_time, mount
        self._frames, self._mounts = Frames(), dict[str, Mount]()
        for _, message in self._messages(TRANSFORMS):
            self._frames.add(message)
        kinds = {connection.topic: connection.msgtype for connection in reader.connections}
        own = {topic for topic, kind in kinds.items() if kind == POINTS and topic.startswith("/points/")}
        scans = {
            topic for topic, kind in kinds.items() if kind == SCAN and f"/points/{_short(topic)}" not in own
        }
        self._scans = {topic for topic in own | scans if not topics or topic in topics}
        if missing := sorted(set(topics) - own - scans):
            raise CannotMapBagError(f"the bag has no scans on {', '.join(missing)}")
        if not self._scans:
            raise CannotMapBagError(f"the bag has no {SCAN}: {_listed(kinds)}")
        if ODOMETRY not in kinds.values():
            raise CannotMapBagError(f"the bag has no {ODOMETRY}: {_listed(kinds)}")
        self._no_return = {
            topic: no_return_m(message for _, message in self._messages(SCAN, topic))
            for topic in self._scans
            if kinds[topic] == SCAN
        }

    def _messages(self, kind: str, topic: str = "") -> Iterator[tuple[str, Any]]:
        """Each message of a type, of one topic if it is named."""
        wanted = [
            connection
            for connection in self._reader.connections
            if connection.msgtype == kind and topic in ("", connection.topic)
        ]
        if wanted:  # without any, the reader would give all that there is
            for connection, _, data in self._reader.messages(wanted):
                yield connection.topic, self._reader.deserialize(data, connection.msgtype)

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
        self._base: str | None = None
        self._odometry_frame = ""
        for connection, _, data in self._reader.messages(wanted):
            message = self._reader.deserialize(data, connection.msgtype)
            yield from read[connection.msgtype](connection.topic, message)

    def _odometry(self, topic: str, message: Any) -> Iterator[OdometryUpdated]:
        if self._base is None:
            self._odometry_frame = plain(message.header.frame_id) or "odom"
            self._base = self._frames.base_of(self._odometry_frame, plain(message.child_frame_id))
        pose, twist, stamp_s = message.pose.pose, message.twist.twist, self._stamp_s(message)
        at = pose_in_plane(pose)
        covariance = PoseCovariance(*[float(message.pose.covariance[index]) for index in PLANE])
        yield OdometryUpdated(stamp_s, stamp_s, at, Twist2D(twist.linear.x, twist.angular.z), covariance)

    def _scan(self, topic: str, message: Any) -> Iterator[ScanMeasured]:
        if self._base is not None:
            mount = self._mount(message.header.frame_id)
            stamp_s = self._stamp_s(message)  # of its first beam
            scan = scan_of(message, stamp_s, upside_down=mount.upside_down, no_return=self._no_return[topic])
            yield ScanMeasured(scan.stamp_s, _short(topic), mount.place, scan)

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
        if self._base is not None:  # before the first odometry nobody knows which frame the robot's is
            place = self._mount(message.header.frame_id).place
            yield ScanMeasured(scan.stamp_s, _short(topic), place, scan)

    def _mount(self, frame: str) -> Mount:
        """Where a sensor sits on the robot: as it was said on the command line, or as the bag says."""
        if self._given is not None:
            return self._given
        if frame not in self._mounts:
            try:
                self._mounts[frame] = self._frames.mount(self._base or "", plain(frame), self._odometry_frame)
            except CannotPlaceError as error:
                raise CannotMapBagError(f"{error}. {SAY_MOUNT}") from error
        return self._mounts[frame]

    def _stamp_s(self, message: Any) -> float:
        stamp = message.header.stamp
        return float((stamp.sec * NS + stamp.nanosec - self._begin_ns) / NS)


SAY_MOUNT: Final = (
    "Say where the lidar sits with --mount X Y YAW: metres ahead and to the left of the middle of the robot's axle, and "
    "degrees, counter-clockwise; --upside-down, if it is"
)


def _listed(kinds: Mapping[str, str]) -> str:
    """What a bag has instead, for people."""
    topics = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(kinds.items()))
    return f"it has {topics}" if topics else "it is empty"


def _short(topic: str) -> str:
    return topic.rpartition("/")[2]
