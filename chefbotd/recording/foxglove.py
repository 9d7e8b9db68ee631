"""Messages in the schemas that Foxglove and other viewers know, made from our events.

The schemas are those of github.com/foxglove/foxglove-sdk, ``schemas/jsonschema`` (MIT): FrameTransforms, PoseInFrame,
PosesInFrame, LaserScan, Grid, Log. Fields keep their names and meaning; the frames are those of REP-105.
"""

import base64
import math
import zlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import msgspec
from msgspec import Struct

from chefbotd.core.geometry import Pose2D

if TYPE_CHECKING:
    from chefbotd.core.scan import Floats

ODOM, BASE, MAP = "odom", "base_footprint", "map"
INT8 = 2
"""foxglove.NumericType."""

DEBUG, INFO, WARNING, ERROR = 1, 2, 3, 4
"""foxglove.LogLevel."""


class Time(Struct, frozen=True):
    """Seconds and nanoseconds since 1970."""

    sec: int
    nsec: int


class Vector3(Struct, frozen=True):
    """Metres."""

    x: float
    y: float
    z: float = 0.0


class Quaternion(Struct, frozen=True):
    """A turn about z."""

    z: float
    w: float
    x: float = 0.0
    y: float = 0.0


class Pose(Struct, frozen=True):
    """A place and a turn."""

    position: Vector3
    orientation: Quaternion


class FrameTransform(Struct, frozen=True):
    """Where a frame lies in its parent."""

    timestamp: Time
    parent_frame_id: str
    child_frame_id: str
    translation: Vector3
    rotation: Quaternion


class FrameTransforms(Struct, frozen=True):
    """Several of them."""

    transforms: tuple[FrameTransform, ...]


class PoseInFrame(Struct, frozen=True):
    """A pose at a time."""

    timestamp: Time
    frame_id: str
    pose: Pose


class PosesInFrame(Struct, frozen=True):
    """A path."""

    timestamp: Time
    frame_id: str
    poses: tuple[Pose, ...]


class LaserScan(Struct, frozen=True):
    """Ranges at bearings of equal steps; 0 where there is none."""

    timestamp: Time
    frame_id: str
    pose: Pose
    start_angle: float
    end_angle: float
    ranges: list[float]
    intensities: tuple[float, ...] = ()


class Vector2(Struct, frozen=True):
    """Metres."""

    x: float
    y: float


class PackedElementField(Struct, frozen=True):
    """What lies in each cell."""

    name: str
    offset: int
    type: int


class Grid(Struct, frozen=True):
    """A map: a signed byte a cell, in percent, -1 for unknown; row by row from the lowest y up."""

    timestamp: Time
    frame_id: str
    pose: Pose
    column_count: int
    cell_size: Vector2
    row_stride: int
    cell_stride: int
    fields: tuple[PackedElementField, ...]
    data: str


class Log(Struct, frozen=True):
    """A sentence, and how bad it is."""

    timestamp: Time
    level: int
    message: str
    name: str
    file: str = ""
    line: int = 0


_TIME: Mapping[str, Any] = {
    "type": "object",
    "title": "time",
    "properties": {
        "sec": {"type": "integer", "minimum": 0},
        "nsec": {"type": "integer", "minimum": 0, "maximum": 999_999_999},
    },
}
_INTEGER: Mapping[str, Any] = {"type": "integer", "minimum": 0}
_NUMBER: Mapping[str, Any] = {"type": "number"}
_TEXT: Mapping[str, Any] = {"type": "string"}


def _object(title: str, description: str, **properties: Any) -> dict[str, Any]:
    told = {"title": f"foxglove.{title}", "description": description, "type": "object"}
    return {**told, "properties": properties, "required": list(properties)}


def _array(items: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


_VECTOR3 = _object("Vector3", "A vector in 3D space", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_VECTOR2 = _object("Vector2", "A vector in 2D space", x=_NUMBER, y=_NUMBER)
_QUATERNION = _object("Quaternion", "A rotation in 3D space", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object("Pose", "A position and orientation in 3D space", position=_VECTOR3, orientation=_QUATERNION)
_TRANSFORM = _object(
    "FrameTransform",
    "A transform between two reference frames in 3D space",
    timestamp=_TIME,
    parent_frame_id=_TEXT,
    child_frame_id=_TEXT,
    translation=_VECTOR3,
    rotation=_QUATERNION,
)
_FIELD = _object(
    "PackedElementField",
    "A field present within each element in a byte array of packed elements",
    name=_TEXT,
    offset=_INTEGER,
    type=_INTEGER,
)
SCHEMAS: Mapping[type[Struct], Mapping[str, Any]] = {
    FrameTransforms: _object(
        "FrameTransforms", "An array of FrameTransform messages", transforms=_array(_TRANSFORM)
    ),
    PoseInFrame: _object(
        "PoseInFrame",
        "A timestamped pose for an object or reference frame in 3D space",
        timestamp=_TIME,
        frame_id=_TEXT,
        pose=_POSE,
    ),
    PosesInFrame: _object(
        "PosesInFrame",
        "An array of timestamped poses for an object or reference frame in 3D space",
        timestamp=_TIME,
        frame_id=_TEXT,
        poses=_array(_POSE),
    ),
    LaserScan: _object(
        "LaserScan",
        "A single scan from a planar laser range-finder",
        timestamp=_TIME,
        frame_id=_TEXT,
        pose=_POSE,
        start_angle=_NUMBER,
        end_angle=_NUMBER,
        ranges=_array(_NUMBER),
        intensities=_array(_NUMBER),
    ),
    Grid: _object(
        "Grid",
        "A 2D grid of data",
        timestamp=_TIME,
        frame_id=_TEXT,
        pose=_POSE,
        column_count=_INTEGER,
        cell_size=_VECTOR2,
        row_stride=_INTEGER,
        cell_stride=_INTEGER,
        fields=_array(_FIELD),
        data={"type": "string", "contentEncoding": "base64"},
    ),
    Log: _object(
        "Log",
        "A log message",
        timestamp=_TIME,
        level=_INTEGER,
        message=_TEXT,
        name=_TEXT,
        file=_TEXT,
        line=_INTEGER,
    ),
}


def time_of(stamp_ns: int) -> Time:
    """As the schemas have it."""
    return Time(*divmod(stamp_ns, 1_000_000_000))


def _turn(heading_rad: float) -> Quaternion:
    return Quaternion(math.sin(heading_rad / 2), math.cos(heading_rad / 2))


def pose_of(pose: Pose2D) -> Pose:
    """On the floor."""
    return Pose(Vector3(pose.x_m, pose.y_m), _turn(pose.heading_rad))


def transform(stamp_ns: int, parent: str, child: str, parent_from_child: Pose2D) -> FrameTransform:
    """Where ``child`` lies in ``parent``."""
    place = Vector3(parent_from_child.x_m, parent_from_child.y_m)
    return FrameTransform(time_of(stamp_ns), parent, child, place, _turn(parent_from_child.heading_rad))


def path(stamp_ns: int, x_m: Sequence[float], y_m: Sequence[float]) -> PosesInFrame:
    """A path in the map; each pose looks towards the next."""
    points = list(zip(x_m, y_m, strict=True))
    poses = []
    for index, (x, y) in enumerate(points):
        ahead = points[min(index + 1, len(points) - 1)]
        behind = (x, y) if ahead != (x, y) else points[max(index - 1, 0)]
        poses.append(pose_of(Pose2D(x, y, math.atan2(ahead[1] - behind[1], ahead[0] - behind[0]))))
    return PosesInFrame(time_of(stamp_ns), MAP, tuple(poses))


def laser_scan(stamp_ns: int, base_from_lidar: Pose2D, bearing_rad: "Floats", range_m: "Floats") -> LaserScan:
    """A scan at equal steps, as many as it has beams: each beam goes to the nearest, and of two the nearer stays."""
    import numpy as np  # loaded already, where there are scans

    count = bearing_rad.size
    if not count:
        return LaserScan(time_of(stamp_ns), BASE, pose_of(base_from_lidar), 0.0, 0.0, [])
    wrapped = bearing_rad - math.tau * np.round(bearing_rad / math.tau)
    lowest, highest = float(wrapped.min()), float(wrapped.max())
    step = (highest - lowest) / max(1, count - 1) or 1.0
    index = np.rint((wrapped - lowest) / step).astype(np.intp)
    read = np.isfinite(range_m) & (range_m > 0.0)
    ranges = np.full(count, np.inf)
    np.minimum.at(ranges, index[read], range_m[read])
    ranges[np.isinf(ranges)] = 0.0
    return LaserScan(
        time_of(stamp_ns), BASE, pose_of(base_from_lidar), lowest, highest, np.round(ranges, 4).tolist()
    )


def grid(stamp_ns: int, resolution_m: float, origin: Pose2D, columns: int, cells: bytes) -> Grid:
    """A map whose cells are a signed byte each."""
    return Grid(
        time_of(stamp_ns),
        MAP,
        pose_of(origin),
        columns,
        Vector2(resolution_m, resolution_m),
        columns,
        1,
        (PackedElementField("percent", 0, INT8),),
        base64.b64encode(cells).decode(),
    )


class GrowingGrid:
    """A map put together from the parts that are told of it."""

    def __init__(self) -> None:
        self._cells = bytearray()
        self._shape: tuple[int, int] = (0, 0)

    def take(self, event: Any) -> bytes | None:
        """All cells after a ``MapChanged``; None until there was a whole one, or where its cells cannot be read."""
        shape = (event.rows, event.columns)
        try:
            part = zlib.decompress(event.cells)
        except zlib.error:
            return None
        if len(part) != event.part_rows * event.part_columns:
            return None
        if event.whole:
            self._cells, self._shape = bytearray(b"\xff" * (event.rows * event.columns)), shape
        elif shape != self._shape:
            return None
        width = event.part_columns
        for row in range(event.part_rows):
            at = (event.row + row) * event.columns + event.column
            self._cells[at : at + width] = part[row * width : (row + 1) * width]
        return bytes(self._cells)


encode = msgspec.json.encode
