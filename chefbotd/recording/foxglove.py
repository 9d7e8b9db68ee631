"""Converts events to messages that Foxglove and other viewers draw. The frames are those of REP-105."""

import base64
import math
import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import msgspec

from chefbotd.core.geometry import Pose2D
from chefbotd.recording.foxglove_messages import (
    Base64,
    FrameTransform,
    Grid,
    LaserScan,
    PackedElementField,
    Pose,
    PosesInFrame,
    Quaternion,
    Time,
    Vector2,
    Vector3,
)

if TYPE_CHECKING:
    from chefbotd.core.scan import Floats

ODOM, BASE, MAP = "odom", "base_footprint", "map"
INT8 = 2
"""foxglove.NumericType."""

INFO, WARNING, ERROR = 2, 3, 4
"""foxglove.LogLevel."""


def time_of(stamp_ns: int) -> Time:
    """As the schemas have it."""
    return Time(*divmod(stamp_ns, 1_000_000_000))


def _turn(heading_rad: float) -> Quaternion:
    return Quaternion(0.0, 0.0, math.sin(heading_rad / 2), math.cos(heading_rad / 2))


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
        Base64(base64.b64encode(cells).decode()),
    )


class GrowingGrid:
    """A map put together from the parts that are told of it."""

    def __init__(self) -> None:
        self._cells = bytearray()
        self._shape: tuple[int, int] = (0, 0)

    def apply(self, event: Any) -> bytes | None:
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
