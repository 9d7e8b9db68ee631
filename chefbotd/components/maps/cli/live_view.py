"""The map that is being made: it is put together from the topic ``map``, and drawn again with each change."""

import base64
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeAlias

import numpy as np
from msgspec import Struct, field
from rich.console import Group, RenderableType
from rich.live import Live
from rich.text import Text

from chefbotd.cli.common.console import Printer
from chefbotd.cli.common.echo import writing
from chefbotd.client import Client
from chefbotd.client.errors import ProtocolError
from chefbotd.client.models import MapData, MapPoseData, OdometryData
from chefbotd.components.maps.cli.draw import MapMark, draw_map
from chefbotd.core.geometry import Pose2D
from chefbotd.core.grid_patch import GridAssembler, GridPatch
from chefbotd.core.occupancy_grid import OccupancyGrid

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
        if data.state == "ended":
            self._map_from_odom = None
        elif self._readings:
            index = min(bisect_left([when for when, _ in self._readings], stamp_s), len(self._readings) - 1)
            odom_from_base = self._readings[index][1]
            self._map_from_odom = Pose2D(data.x_m, data.y_m, data.heading_rad).compose(
                odom_from_base.inverse()
            )


STATUS_ROWS, ROWS_IN_A_FILE = 4, 45
ROBOT = "bold red"
TOPICS = ("map", "map_pose", "mapping", "odometry")


class MappingScene(Struct):
    """The map so far, the robot in it, and how mapping stands."""

    live: ReceivedMap = field(default_factory=ReceivedMap)
    tracker: MapTracker = field(default_factory=MapTracker)
    doing: str = ""
    state: str = ""
    fit: float = 0.0
    loops: int = 0
    keyframes: int = 0


Show: TypeAlias = Callable[[MappingScene], None]


async def listen(robot: Client, scene: MappingScene, show: Show) -> None:
    """Take in what is told of the map, and show each change, until cancelled.

    One that begins in mid-mapping sees the map after ten seconds at most, when it is told as a whole again.
    """
    async with robot.subscribe(TOPICS, policy="ordered") as events:
        async for event in events:
            take_event(scene, event)
            if event.topic == "map":
                show(scene)


def take_event(scene: MappingScene, event: Any) -> None:
    """Take in an event of these topics."""
    if event.topic == "odometry":
        scene.tracker.take_odometry(event.stamp_s, event.data)
    elif event.topic == "map_pose":
        scene.tracker.take_map_pose(event.stamp_s, event.data)
        scene.state, scene.fit = event.data.state, event.data.fit
    elif event.topic == "mapping":
        scene.loops, scene.keyframes = event.data.loops, event.data.keyframes
    else:
        scene.live.take_part(event.data)


class LiveMapView:
    """A picture that is drawn again on a terminal; lines in a file; nothing for a script."""

    def __init__(self, *, quiet: bool) -> None:
        self._console = Printer(quiet=quiet, highlight=False)
        self._printed = ""

    def print(self, *parts: RenderableType, soft_wrap: bool = False) -> None:
        """Print these below one another; with ``soft_wrap``, lines stay as long as they are."""
        with writing():
            for part in parts:
                self._console.print(part, soft_wrap=soft_wrap)

    @contextmanager
    def showing(self) -> Iterator[Show]:
        """Yield what shows each change."""
        if not self._console.redraws:
            yield self._say_what_is_new
            return
        with Live(console=self._console, auto_refresh=False, transient=True) as live:
            yield lambda scene: live.update(self._picture(scene), refresh=True)

    def _say_what_is_new(self, scene: MappingScene) -> None:
        doing = scene.doing.partition(" (")[0]
        if doing != self._printed:
            self._printed = doing
            self.print(f"{scene.doing}, {_standing(scene)}" if scene.state else scene.doing)

    def _picture(self, scene: MappingScene) -> Group:
        head = Text(f"{scene.doing} ... {_standing(scene)}" if scene.state else f"{scene.doing} ...", "bold")
        if scene.live.grid is None:
            return Group(head)
        return Group(head, self.drawn(scene.live.grid, scene.tracker.pose))

    def drawn(self, grid: OccupancyGrid, pose: Pose2D | None) -> Text:
        """The map with the robot in it, as large as the terminal is."""
        marks = [] if pose is None else [MapMark(pose.x_m, pose.y_m, pose.heading_rad, style=ROBOT)]
        color = self._console.draws_color
        rows = max(1, self._console.height - STATUS_ROWS) if self._console.redraws else ROWS_IN_A_FILE
        return draw_map(grid, self._console.width, rows, marks, color=color)


def _standing(scene: MappingScene) -> str:
    return f"{scene.keyframes} scans kept, {scene.loops} loops closed, fit {scene.fit:.2f}, {scene.state}"
