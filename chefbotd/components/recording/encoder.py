"""Encodes events as messages on the channel of their class, and as messages that viewers can draw."""

import base64
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import msgspec
from msgspec import Struct

from chefbotd.components.recording import foxglove as fg
from chefbotd.components.recording import foxglove_messages as fm
from chefbotd.components.recording.chunk import Channels
from chefbotd.core.events.robot import POSE_ENDED
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import LogLine
from chefbotd.event_classes import encode_scan, encode_words

POSE: Mapping[str, Any] = {
    "type": "object",
    "properties": {name: {"type": "number"} for name in ("x_m", "y_m", "heading_rad")},
}
NUMBERS: Mapping[str, Any] = {"type": "array", "items": {"type": ["number", "null"]}}
SCAN: Mapping[str, Any] = {
    "title": "ScanMeasured",
    "description": "A whole turn of a lidar, mounted at base_from_lidar; invalid readings are 0.",
    "type": "object",
    "properties": {
        "stamp_s": {"type": "number"},
        "lidar": {"type": "string"},
        "base_from_lidar": POSE,
        "scan": {
            "type": "object",
            "properties": {
                "stamp_s": {"type": "number"},
                "bearing_rad": NUMBERS,
                "range_m": NUMBERS,
                "after_s": NUMBERS,
            },
            "required": ["stamp_s", "bearing_rad", "range_m", "after_s"],
        },
    },
    "required": ["stamp_s", "lidar", "base_from_lidar", "scan"],
}
"""Of the one event whose arrays are numpy's."""


def schema_of(event_class: type[Any]) -> Mapping[str, Any]:
    """The schema of an event's JSON."""
    if event_class.__name__ == "ScanMeasured":
        return SCAN
    schema = msgspec.json.schema(event_class)
    definitions = schema.pop("$defs", {})
    resolved: Mapping[str, Any] = _resolve_schema(schema, definitions)
    return resolved


def _resolve_schema(schema: Any, definitions: Mapping[str, Any]) -> Any:
    if isinstance(schema, list | tuple):
        return [_resolve_schema(item, definitions) for item in schema]
    if not isinstance(schema, dict):
        return schema
    reference = schema.get("$ref")
    if isinstance(reference, str):
        return _resolve_schema(definitions[reference.rpartition("/")[2]], definitions)
    return {key: _resolve_schema(value, definitions) for key, value in schema.items()}


LINK = "{link}"
"""Stands in a channel's name for the event's link."""

REPEATED = 0
"""The sequence number of repeated messages: no event happened then."""

DRAWN_NS = 45_000_000
"""Transforms and poses are drawn at most about 20 times a second; the events have them all."""

MapEvent = tuple[Any, int, int]
"""An event whose map is to be drawn, its time, and its number."""


class Sink(Protocol):
    """What takes messages."""

    def add(self, channel: int, sequence: int, log_ns: int, payload: bytes) -> None:
        """Add one."""
        ...


class _Plan(Struct):
    """How events of a class become messages; ``channel`` is None where ``topic`` depends on the event's link."""

    topic: str
    channel: int | None
    has_arrival: bool
    encode: Callable[[Any], bytes]
    draw: Callable[[Any, int], None] | None
    log_line: Callable[[Any], LogLine] | None
    is_retained: bool


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
        self._retained: dict[tuple[int, str], bytes] = {}
        self._drawings = {
            "odometry": self._draw_odometry,
            "odometry_reset": self._draw_at_once,
            "map_pose": self._draw_map_pose,
            "scan": self._draw_scan,
            "map": self._keep_map,
            "path": self._draw_path,
            "picture": self._draw_picture,
        }
        self._drawn_ns = 0
        self._map_from_odom: Pose2D | None = None
        self._maps: list[MapEvent] = []
        self._log_lines: dict[str, LogLine] = {}
        self.sequence = 0

    def encode_event(self, event: Any) -> None:
        """Write an event; raises any error of its encoding."""
        self.sequence += 1
        plan = self._plans.get(type(event))
        if plan is None:
            plan = self._plans[type(event)] = self._plan(type(event))
        stamp_s = event.arrival_s if plan.has_arrival else event.stamp_s
        log_ns = self._offset_ns + int(stamp_s * 1e9)
        payload = plan.encode(event)
        channel = plan.channel
        if channel is None:
            channel = self._link_channel(plan.topic, event)
        self._sink.add(channel, self.sequence, log_ns, payload)
        if plan.draw is not None:
            plan.draw(event, log_ns)
        if plan.log_line is not None:
            self._write_log(plan.log_line(event), log_ns)
        if plan.is_retained:
            self._retained[channel, getattr(event, "lidar", "")] = payload

    def ns_of(self, stamp_s: float) -> int:
        """Nanoseconds since 1970 of a time of the daemon's."""
        return self._offset_ns + round(stamp_s * 1e9)

    def holds(self) -> tuple[tuple[int, bytes], ...]:
        """What still holds, as channels and payloads: for the beginning of a file."""
        return tuple((channel, payload) for (channel, _), payload in self._retained.items())

    def take_maps(self) -> tuple[MapEvent, ...]:
        """The events since the last call whose map is to be drawn."""
        maps, self._maps = tuple(self._maps), []
        return maps

    # how a class is written

    def _plan(self, event_class: type[Any]) -> _Plan:
        name = event_class.__name__
        topic = getattr(event_class, "recorded_as", f"/events/{name}")
        channel = None if LINK in topic else self._channel(topic, event_class)
        return _Plan(
            topic,
            channel,
            "arrival_s" in event_class.__annotations__,
            encode_scan if name == "ScanMeasured" else getattr(event_class, "encode_recorded", encode_words),
            self._drawings.get(getattr(event_class, "drawn_as", "")),
            getattr(event_class, "log_line", None),
            getattr(event_class, "retained", False),
        )

    def _channel(self, topic: str, event_class: type[Any]) -> int:
        return self._channels.number(topic, f"chefbotd.{event_class.__name__}", schema_of(event_class))

    def _link_channel(self, topic: str, event: Any) -> int:
        channel = self._links.get((topic, event.link))
        if channel is None:
            channel = self._channel(topic.replace(LINK, event.link), type(event))
            self._links[topic, event.link] = channel
        return channel

    def _write_log(self, line: LogLine, log_ns: int) -> None:
        """What a source says twice in a row is written once."""
        if self._log_lines.get(line.source) != line:
            self._log_lines[line.source] = line
            level = fg.LEVELS[line.level]
            self._put_message("/log", fm.Log(fg.time_of(log_ns), level, line.text, line.source), log_ns)

    def _put_message(self, topic: str, message: Struct, log_ns: int) -> tuple[int, bytes]:
        kind = type(message)
        channel = self._channels.number(topic, f"foxglove.{kind.__name__}", fm.SCHEMAS[kind])
        payload = encode_words(message)
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
            self._put_message("/tf", fm.FrameTransforms((moved,)), log_ns)
        else:
            held = fg.transform(stamp_ns, fg.MAP, fg.ODOM, self._map_from_odom)
            self._put_message("/tf", fm.FrameTransforms((held, moved)), log_ns)
            frame, pose = fg.MAP, self._map_from_odom.compose(odom_from_base)
        self._put_message("/pose", fm.PoseInFrame(fg.time_of(stamp_ns), frame, fg.pose_of(pose)), log_ns)

    def _draw_at_once(self, event: Any, log_ns: int) -> None:
        self._drawn_ns = 0

    def _draw_map_pose(self, event: Any, log_ns: int) -> None:
        self._map_from_odom = None if event.state == POSE_ENDED else event.map_from_odom

    def _draw_scan(self, event: Any, log_ns: int) -> None:
        topic = "/scan" if event.lidar in (self._first_scanner, None) else f"/scan/{event.lidar}"
        scan = event.scan
        stamp_ns = self.ns_of(event.stamp_s)
        drawn = fg.laser_scan(stamp_ns, event.base_from_lidar, scan.bearing_rad, scan.range_m)
        self._put_message(topic, drawn, log_ns)

    def _keep_map(self, event: Any, log_ns: int) -> None:
        self._maps.append((event, log_ns, self.sequence))

    def _draw_path(self, event: Any, log_ns: int) -> None:
        path = fg.path(self.ns_of(event.stamp_s), event.x_m, event.y_m)
        channel, payload = self._put_message("/path", path, log_ns)
        self._retained[channel, ""] = payload

    def _draw_picture(self, event: Any, log_ns: int) -> None:
        if event.jpeg:
            data = fm.Base64(base64.b64encode(event.jpeg).decode("ascii"))
            stamp = fg.time_of(self.ns_of(event.stamp_s))
            self._put_message("/camera", fm.CompressedImage(stamp, "camera", data, "jpeg"), log_ns)
