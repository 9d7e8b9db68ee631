"""What is shown of a navigating robot, the map, the path, the people and the state of the goal, and a picture of it."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeAlias

from msgspec import Struct, field
from rich.console import Group, RenderableType
from rich.live import Live
from rich.text import Text

from chefbotd.cli.common.console import Printer
from chefbotd.cli.common.echo import writing
from chefbotd.client import Client
from chefbotd.components.maps.cli.draw import MapMark, draw_map
from chefbotd.components.maps.cli.live_view import MapTracker
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.core.occupancy_grid import OccupancyGrid

Disc = tuple[float, float, float]
"""x, y and radius in metres."""


RATE_HZ = 5.0
TOPICS = ("odometry", "map_pose", "navigation", "path", "localization")
ENDS = frozenset(End)
ROBOT, PATH, PLACE, SOMEBODY = "bold red", "green", "bold blue", "bold magenta"


class NavigationScene(Struct):
    """The newest of each."""

    grid: OccupancyGrid | None = None
    places: tuple[MapMark, ...] = ()
    tracker: MapTracker = field(default_factory=MapTracker)
    path: tuple[tuple[float, float], ...] = ()
    discs: tuple[Disc, ...] = ()
    doing: str = ""
    state: str = "idle"
    reason: str = ""
    distance_m: float | None = None
    time_s: float | None = None
    localization: str = "unknown"
    _past_goal: int | None = None
    _heard: bool = False

    def take_event(self, event: Any) -> None:
        """Take in an event of ``TOPICS``."""
        data = event.data
        if event.topic == "odometry":
            self.tracker.take_odometry(event.stamp_s, data)
        elif event.topic == "map_pose":
            self.tracker.take_map_pose(event.stamp_s, data)
        elif event.topic == "localization":
            self.localization = data.state
        elif event.topic == "navigation":
            self._take_navigation(data)
        elif event.topic == "path":
            self.path = tuple(zip(data.x_m, data.y_m, strict=True))

    def _take_navigation(self, data: Any) -> None:
        """What it does; how somebody's last goal ended before this scene began is not told again."""
        if not self._heard:
            self._heard, self._past_goal = True, data.goal if data.state in ENDS else None
        if data.state in ENDS and data.goal is not None and data.goal == self._past_goal:
            return
        self.state, self.reason = data.state, data.reason
        self.distance_m, self.time_s = data.distance_m, data.time_s

    def marks(self) -> list[MapMark]:
        """What is drawn on the map, the later above the earlier."""
        marks = [MapMark(x, y, style=PATH, sign="·") for x, y in self.path]
        marks += self.places
        marks += [MapMark(x, y, style=SOMEBODY, sign="o") for x, y, _ in self.discs]
        if (pose := self.tracker.pose) is not None:
            marks.append(MapMark(pose.x_m, pose.y_m, pose.heading_rad, style=ROBOT))
        return marks


Show: TypeAlias = Callable[[NavigationScene], None]


async def listen(robot: Client, scene: NavigationScene, show: Show) -> None:
    """Take in what is told, and show each change of the pose, until cancelled."""
    async with robot.subscribe(TOPICS, max_rate_hz=RATE_HZ) as events:
        async for event in events:
            scene.take_event(event)
            if event.topic in ("odometry", "navigation"):
                show(scene)


STATUS_ROWS, ROWS_IN_A_FILE = 5, 45


class NavigationView:
    """A picture on a terminal; lines in a file; nothing for a script."""

    def __init__(self, *, quiet: bool) -> None:
        self._console = Printer(quiet=quiet, highlight=False)
        self._last_text, self._draw_again_s = "", 0.0

    def print(self, *parts: RenderableType) -> None:
        """Print these below one another."""
        with writing():
            for part in parts:
                self._console.print(part)

    @contextmanager
    def showing(self) -> Iterator[Show]:
        """Yield what shows each change."""
        if not self._console.redraws:
            yield self._say_what_is_new
            return
        with Live(console=self._console, auto_refresh=False, transient=True) as live:
            yield lambda scene: self._draw(live, scene)

    def _draw(self, live: Live, scene: NavigationScene) -> None:
        """Draw, but spend no more than a quarter of the time on it: the computer has a robot to simulate."""
        began_s = time.monotonic()
        if began_s < self._draw_again_s:
            return
        live.update(self.picture(scene), refresh=True)
        self._draw_again_s = began_s + 4 * (time.monotonic() - began_s)

    def _say_what_is_new(self, scene: NavigationScene) -> None:
        text = f"{scene.doing}: {scene.reason}" if scene.state != "idle" and scene.reason else scene.doing
        if text != self._last_text:
            self._last_text = text
            self.print(text)

    def picture(self, scene: NavigationScene) -> Group:
        """The map with all that is on it, and what the robot does."""
        head = Text(f"{scene.doing} ...", "bold")
        if scene.grid is None:
            return Group(head)
        return Group(head, Text(_standing(scene)), self.drawn(scene))

    def drawn(self, scene: NavigationScene) -> Text:
        """The map with all that is on it, as large as the terminal is."""
        if scene.grid is None:
            return Text()
        rows = max(1, self._console.height - STATUS_ROWS) if self._console.redraws else ROWS_IN_A_FILE
        return draw_map(scene.grid, self._console.width, rows, scene.marks(), color=self._console.draws_color)


def _standing(scene: NavigationScene) -> str:
    left = "" if scene.distance_m is None else f", {scene.distance_m:.1f} m to go"
    return (
        f"{scene.localization}, {scene.state}{left}: {scene.reason}" if scene.reason else scene.localization
    )
