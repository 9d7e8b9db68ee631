"""Puts the growing map together from the topic ``map``, with the robot's pose in it."""

import base64
import zlib
from bisect import bisect_left
from collections import deque

import numpy as np

from chefbotd.client.errors import ProtocolError
from chefbotd.client.models import MapData, MapPoseData, OdometryData
from chefbotd.core.geometry import Pose2D
from chefbotd.mapping.occupancy_grid import OccupancyGrid

REMEMBERED_READINGS = 400


class LiveMap:
    """Its cells so far. A part that does not follow the last one leaves it as it is, until a whole one comes."""

    def __init__(self) -> None:
        self._grid: OccupancyGrid | None = None
        self._revision = 0

    @property
    def grid(self) -> OccupancyGrid | None:
        """What is known; None before the first whole one."""
        return self._grid

    def take_part(self, part: MapData) -> bool:
        """Take in what has changed; False: parts before it were missed, and it was left out.

        Raises:
            ProtocolError: the part is not what it says it is.
        """
        cells = _cells(part)
        if part.whole:
            origin = Pose2D(part.x_m, part.y_m, part.heading_rad)
            self._grid = OccupancyGrid(part.resolution_m, origin, cells)
        elif self._grid is None or part.revision != self._revision + 1:
            return False
        else:
            percent = self._grid.percent
            if (
                part.row + part.part_rows > percent.shape[0]
                or part.column + part.part_columns > percent.shape[1]
            ):
                raise ProtocolError("map: a part lies outside of the map")
            percent[part.row : part.row + part.part_rows, part.column : part.column + part.part_columns] = (
                cells
            )
        self._revision = part.revision
        return True


def _cells(part: MapData) -> "np.ndarray[tuple[int, ...], np.dtype[np.int8]]":
    expected = part.part_rows * part.part_columns
    try:
        data = zlib.decompressobj().decompress(base64.b64decode(part.cells, validate=True), expected + 1)
    except (ValueError, zlib.error) as error:
        raise ProtocolError(f"map: the cells cannot be unpacked: {error}") from error
    if len(data) != expected:
        raise ProtocolError(f"map: {expected} cells were expected, but at least {len(data)} arrived")
    return np.frombuffer(data, np.int8).reshape(part.part_rows, part.part_columns).copy()


class MapTracker:
    """Where the robot is in the map: as of the last scan, and moved on by odometry since."""

    def __init__(self) -> None:
        self._readings: deque[tuple[float, Pose2D]] = deque(maxlen=REMEMBERED_READINGS)
        self._map_from_odom: Pose2D | None = None

    @property
    def pose(self) -> Pose2D | None:
        """Where it is now; None before the first scan."""
        if self._map_from_odom is None or not self._readings:
            return None
        return self._map_from_odom.compose(self._readings[-1][1])

    def take_odometry(self, stamp_s: float, data: OdometryData) -> None:
        """It has moved on."""
        self._readings.append((stamp_s, Pose2D(data.x_m, data.y_m, data.heading_rad)))

    def take_map_pose(self, stamp_s: float, data: MapPoseData) -> None:
        """A scan says where it was at ``stamp_s``."""
        if self._readings:
            index = min(bisect_left([when for when, _ in self._readings], stamp_s), len(self._readings) - 1)
            odom_from_base = self._readings[index][1]
            self._map_from_odom = Pose2D(data.x_m, data.y_m, data.heading_rad).compose(
                odom_from_base.inverse()
            )
