"""Puts the growing map together from the topic ``map``, with the robot's pose in it."""

import base64
from bisect import bisect_left
from collections import deque

import numpy as np

from chefbotd.client.errors import ProtocolError
from chefbotd.client.models import MapData, MapPoseData, OdometryData
from chefbotd.core.geometry import Pose2D
from chefbotd.core.grid_patch import GridAssembler, GridPatch
from chefbotd.mapping.occupancy_grid import OccupancyGrid

REMEMBERED_READINGS = 400


class ReceivedMap:
    """Its cells so far. A part that does not follow the last one leaves it as it is, until a whole one comes."""

    def __init__(self) -> None:
        self._assembler = GridAssembler()
        self.grid: OccupancyGrid | None = None
        """What is known; None before the first whole one."""

    def take_part(self, part: MapData) -> bool:
        """Take in what has changed; False: parts before it were missed, and it was left out.

        Raises:
            ProtocolError: the part is not what it says it is.
        """
        try:
            followed = self._assembler.add(_patch(part), whole=part.whole)
        except ValueError as error:
            raise ProtocolError(f"map: {error}") from error
        if followed:
            percent = np.frombuffer(self._assembler.cells, np.int8).reshape(part.rows, part.columns)
            origin = Pose2D(part.x_m, part.y_m, part.heading_rad)
            self.grid = OccupancyGrid(part.resolution_m, origin, percent)
        return followed


def _patch(part: MapData) -> GridPatch:
    fields = {name: getattr(part, name) for name in GridPatch.__struct_fields__ if hasattr(part, name)}
    cells = base64.b64decode(part.cells, validate=True)
    origin = Pose2D(part.x_m, part.y_m, part.heading_rad)
    return GridPatch(**fields | {"stamp_s": 0.0, "map_from_grid": origin, "cells": cells})


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
