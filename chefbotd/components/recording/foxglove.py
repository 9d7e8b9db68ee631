"""Converts events to messages that Foxglove and other viewers draw. The frames are those of REP-105."""

import base64
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import msgspec

from chefbotd.components.recording import foxglove_messages as fm
from chefbotd.components.recording.chunk import Channels, ChunkBuilder
from chefbotd.components.recording.foxglove_messages import (
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
from chefbotd.core.geometry import Pose2D
from chefbotd.core.grid_patch import GridAssembler
from chefbotd.core.record import Level

if TYPE_CHECKING:
    from chefbotd.core.scan import Floats


ODOM, BASE, MAP = "odom", "base_footprint", "map"
INT8 = 2
"""foxglove.NumericType."""

LEVELS = {Level.INFO: 2, Level.WARNING: 3, Level.ERROR: 4}
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


encode = msgspec.json.encode


Cells = tuple[float, Pose2D, int, bytes]
"""Resolution in metres, ``map_from_grid``, columns, and a signed byte for each cell."""

ReadMap = Callable[[Any], Cells | None]


class MapDrawer:
    """Keeps the map that is in use or being made. ``read_map`` gives the cells of a stored one by its ``MapLoaded``."""

    def __init__(self, channels: Channels, read_map: ReadMap) -> None:
        self._channels, self._read_map = channels, read_map
        self._growing = GridAssembler()
        self._payload: bytes | None = None
        self.drawn_ns = 0

    def draw(self, event: Any, log_ns: int, sequence: int, sink: ChunkBuilder) -> None:
        """Draw the map after this event of it; one that cannot be read is not drawn."""
        cells = self._read_map(event) if type(event).__name__ == "MapLoaded" else self._grown(event)
        if cells is not None:
            self._payload = msgspec.json.encode(grid(log_ns, *cells))
            self.tell(log_ns, sequence, sink)

    def _grown(self, event: Any) -> Cells | None:
        """All cells after a ``MapChanged``; None until there was a whole one, or where its cells cannot be read."""
        try:
            followed = self._growing.add(event, whole=event.whole)
        except ValueError:
            return None
        return (
            (event.resolution_m, event.map_from_grid, event.columns, self._growing.cells)
            if followed
            else None
        )

    def tell(self, log_ns: int, sequence: int, sink: ChunkBuilder) -> None:
        """Write the map as it is, if there is one."""
        if self._payload is not None:
            self.drawn_ns = log_ns
            channel = self._channels.number("/map", "foxglove.Grid", fm.SCHEMAS[fm.Grid])
            sink.add(channel, sequence, log_ns, self._payload)
