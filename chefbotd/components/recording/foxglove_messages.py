"""Messages in the schemas that Foxglove and other viewers know; their docstrings are the descriptions there.

The schemas are those of github.com/foxglove/foxglove-sdk, ``schemas/jsonschema`` (MIT): FrameTransforms, PoseInFrame,
PosesInFrame, LaserScan, Grid, CompressedImage, Log. Fields keep their names and meaning.
"""

from collections.abc import Mapping
from typing import Any, NewType, get_args

from msgspec import Struct
from msgspec.structs import fields

Base64 = NewType("Base64", str)


class Time(Struct, frozen=True):
    """Seconds and nanoseconds since 1970."""

    sec: int
    nsec: int


class Vector3(Struct, frozen=True):
    """A vector in 3D space."""

    x: float
    y: float
    z: float = 0.0


class Quaternion(Struct, frozen=True):
    """A rotation in 3D space."""

    x: float
    y: float
    z: float
    w: float


class Pose(Struct, frozen=True):
    """A position and orientation in 3D space."""

    position: Vector3
    orientation: Quaternion


class FrameTransform(Struct, frozen=True):
    """A transform between two reference frames in 3D space."""

    timestamp: Time
    parent_frame_id: str
    child_frame_id: str
    translation: Vector3
    rotation: Quaternion


class FrameTransforms(Struct, frozen=True):
    """An array of FrameTransform messages."""

    transforms: tuple[FrameTransform, ...]


class PoseInFrame(Struct, frozen=True):
    """A timestamped pose for an object or reference frame in 3D space."""

    timestamp: Time
    frame_id: str
    pose: Pose


class PosesInFrame(Struct, frozen=True):
    """An array of timestamped poses for an object or reference frame in 3D space."""

    timestamp: Time
    frame_id: str
    poses: tuple[Pose, ...]


class LaserScan(Struct, frozen=True):
    """A single scan from a planar laser range-finder."""

    timestamp: Time
    frame_id: str
    pose: Pose
    start_angle: float
    end_angle: float
    ranges: list[float]
    intensities: tuple[float, ...] = ()


class Vector2(Struct, frozen=True):
    """A vector in 2D space."""

    x: float
    y: float


class PackedElementField(Struct, frozen=True):
    """A field present within each element in a byte array of packed elements."""

    name: str
    offset: int
    type: int


class Grid(Struct, frozen=True):
    """A 2D grid of data."""

    timestamp: Time
    frame_id: str
    pose: Pose
    column_count: int
    cell_size: Vector2
    row_stride: int
    cell_stride: int
    fields: tuple[PackedElementField, ...]
    data: Base64


class CompressedImage(Struct, frozen=True):
    """A compressed image."""

    timestamp: Time
    frame_id: str
    data: Base64
    format: str


class Log(Struct, frozen=True):
    """A log message."""

    timestamp: Time
    level: int
    message: str
    name: str
    file: str = ""
    line: int = 0


_SCALARS: Mapping[Any, Mapping[str, Any]] = {
    int: {"type": "integer", "minimum": 0},
    float: {"type": "number"},
    str: {"type": "string"},
    Base64: {"type": "string", "contentEncoding": "base64"},
    Time: {
        "type": "object",
        "title": "time",
        "properties": {
            "sec": {"type": "integer", "minimum": 0},
            "nsec": {"type": "integer", "minimum": 0, "maximum": 999_999_999},
        },
    },
}


def _schema(kind: Any) -> Mapping[str, Any]:
    """The JSON Schema of a field's type, or of a message."""
    if kind in _SCALARS:
        return _SCALARS[kind]
    if items := get_args(kind):
        return {"type": "array", "items": _schema(items[0])}
    properties = {field.name: _schema(field.type) for field in fields(kind)}
    head = {"title": f"foxglove.{kind.__name__}", "description": kind.__doc__.rstrip("."), "type": "object"}
    return {**head, "properties": properties, "required": list(properties)}


SCHEMAS: Mapping[type[Struct], Mapping[str, Any]] = {
    kind: _schema(kind)
    for kind in (FrameTransforms, PoseInFrame, PosesInFrame, LaserScan, Grid, CompressedImage, Log)
}
