"""Encodes events as messages on the channel of their class, and as messages that viewers can draw."""

from collections.abc import Callable
from typing import Any, Protocol

import msgspec
from msgspec import Struct

from chefbotd.core.geometry import Pose2D
from chefbotd.recording import foxglove as fg
from chefbotd.recording import foxglove_messages as fm
from chefbotd.recording.channels import Channels
from chefbotd.recording.classes import encode_scan
from chefbotd.recording.schemas import schema_of
from chefbotd.recording.sentences import SENTENCES, Sentence

LINKS = {"LinkBytesRead": "read", "LinkBytesWritten": "written"}
REQUESTS = {"RequestHandled": "/requests"}
STATES = frozenset(
    {
        "SafetyChanged",
        "LinkOpened",
        "ControlChanged",
        "MapLoaded",
        "MappingChanged",
        "LocalizationChanged",
        "NavigationChanged",
        "DepthCameraChanged",
        "LidarChanged",
        "WorkerReported",
    }
)
"""Classes whose last event still holds when a file begins: it is told again there."""

REPEATED = 0
"""The sequence number of what is told again: nothing happened then."""

DRAWN_NS = 45_000_000
"""Transforms and poses are drawn at most about 20 times a second; the events have them all."""

MapEvent = tuple[Any, int, int]
"""An event of which the map is to be drawn, when, and its number."""


class Sink(Protocol):
    """What takes messages."""

    def add(self, channel: int, sequence: int, log_ns: int, payload: bytes) -> None:
        """Add one."""
        ...


class _Plan(Struct):
    """How events of a class become messages; ``channel`` is None where it depends on the link."""

    name: str
    channel: int | None
    has_arrival: bool
    encode: Callable[[Any], bytes]
    draw: Callable[[Any, int], None] | None
    sentence: Callable[[Any], Sentence] | None
    is_state: bool


class Encoder:
    """Writes messages into ``sink``. ``offset_ns`` makes times since 1970 of the daemon's monotonic ones.

    ``first_scanner`` is whose scans are on ``/scan``; those of others are on ``/scan/NAME``. ``sequence`` numbers the
    events, from 1 on, over all files.
    """

    def __init__(self, sink: Sink, channels: Channels, offset_ns: int, first_scanner: str | None) -> None:
        self._sink, self._channels, self._offset_ns = sink, channels, offset_ns
        self._first_scanner = first_scanner
        self._plans: dict[type[Any], _Plan] = {}
        self._links: dict[tuple[str, str], int] = {}
        self._states: dict[tuple[int, str], bytes] = {}
        self._drawings = {
            "OdometryUpdated": self._draw_odometry,
            "MapPoseUpdated": self._draw_map_pose,
            "OdometryReset": self._draw_at_once,
            "ScanMeasured": self._draw_scan,
            "MapChanged": self._keep_map,
            "MapLoaded": self._keep_map,
            "PathChanged": self._draw_path,
        }
        self._drawn_ns = 0
        self._map_from_odom: Pose2D | None = None
        self._maps: list[MapEvent] = []
        self._said: dict[str, Sentence] = {}
        self.sequence = 0

    def encode_event(self, event: Any) -> None:
        """Write an event; raises whatever it is that it cannot be written for."""
        self.sequence += 1
        plan = self._plans.get(type(event))
        if plan is None:
            plan = self._plans[type(event)] = self._plan(type(event))
        stamp_s = event.arrival_s if plan.has_arrival else event.stamp_s
        log_ns = self._offset_ns + int(stamp_s * 1e9)
        payload = plan.encode(event)
        channel = plan.channel
        if channel is None:
            channel = self._link_channel(plan.name, event.link, type(event))
        self._sink.add(channel, self.sequence, log_ns, payload)
        if plan.draw is not None:
            plan.draw(event, log_ns)
        if plan.sentence is not None:
            self._say(plan.sentence(event), log_ns)
        if plan.is_state:
            self._states[channel, getattr(event, "lidar", "")] = payload

    def ns_of(self, stamp_s: float) -> int:
        """Nanoseconds since 1970 of a time of the daemon's."""
        return self._offset_ns + round(stamp_s * 1e9)

    def holds(self) -> tuple[tuple[int, bytes], ...]:
        """What still holds, as channels and payloads: for the beginning of a file."""
        return tuple((channel, payload) for (channel, _), payload in self._states.items())

    def take_maps(self) -> tuple[MapEvent, ...]:
        """The events since the last time of which a map is to be drawn."""
        maps, self._maps = tuple(self._maps), []
        return maps

    # how a class is written

    def _plan(self, event_class: type[Any]) -> _Plan:
        name = event_class.__name__
        if name in LINKS:
            channel = None
        else:
            topic = REQUESTS.get(name, f"/events/{name}")
            channel = self._channels.number(topic, f"chefbotd.{name}", schema_of(event_class))
        return _Plan(
            name,
            channel,
            "arrival_s" in event_class.__annotations__,
            encode_scan if name == "ScanMeasured" else msgspec.json.encode,
            self._drawings.get(name),
            SENTENCES.get(name),
            name in STATES,
        )

    def _link_channel(self, name: str, link: str, event_class: type[Any]) -> int:
        known = self._links.get((name, link))
        if known is None:
            topic = f"/links/{link}/{LINKS[name]}"
            known = self._channels.number(topic, f"chefbotd.{name}", schema_of(event_class))
            self._links[name, link] = known
        return known

    def _say(self, sentence: Sentence, log_ns: int) -> None:
        level, name, text = sentence
        if self._said.get(name) != sentence:
            self._said[name] = sentence
            self._put("/log", fm.Log(fg.time_of(log_ns), level, text, name), log_ns)

    def _put(self, topic: str, message: Struct, log_ns: int) -> tuple[int, bytes]:
        kind = type(message)
        channel = self._channels.number(topic, f"foxglove.{kind.__name__}", fm.SCHEMAS[kind])
        payload = msgspec.json.encode(message)
        self._sink.add(channel, self.sequence, log_ns, payload)
        return channel, payload

    # what is drawn

    def _draw_odometry(self, event: Any, log_ns: int) -> None:
        if 0 <= log_ns - self._drawn_ns < DRAWN_NS:
            return
        self._drawn_ns = log_ns
        stamp_ns = self.ns_of(event.stamp_s)
        odom_from_base = event.odom_from_base
        moved = fg.transform(stamp_ns, fg.ODOM, fg.BASE, odom_from_base)
        frame, pose = fg.ODOM, odom_from_base
        if self._map_from_odom is None:
            self._put("/tf", fm.FrameTransforms((moved,)), log_ns)
        else:
            held = fg.transform(stamp_ns, fg.MAP, fg.ODOM, self._map_from_odom)
            self._put("/tf", fm.FrameTransforms((held, moved)), log_ns)
            frame, pose = fg.MAP, self._map_from_odom.compose(odom_from_base)
        self._put("/pose", fm.PoseInFrame(fg.time_of(stamp_ns), frame, fg.pose_of(pose)), log_ns)

    def _draw_at_once(self, event: Any, log_ns: int) -> None:
        self._drawn_ns = 0

    def _draw_map_pose(self, event: Any, log_ns: int) -> None:
        self._map_from_odom = event.map_from_odom

    def _draw_scan(self, event: Any, log_ns: int) -> None:
        topic = "/scan" if event.lidar in (self._first_scanner, None) else f"/scan/{event.lidar}"
        scan = event.scan
        stamp_ns = self.ns_of(event.stamp_s)
        drawn = fg.laser_scan(stamp_ns, event.base_from_lidar, scan.bearing_rad, scan.range_m)
        self._put(topic, drawn, log_ns)

    def _keep_map(self, event: Any, log_ns: int) -> None:
        self._maps.append((event, log_ns, self.sequence))

    def _draw_path(self, event: Any, log_ns: int) -> None:
        path = fg.path(self.ns_of(event.stamp_s), event.x_m, event.y_m)
        channel, payload = self._put("/path", path, log_ns)
        self._states[channel, ""] = payload
