"""The content of a navigation screen: the map, the path, the robot, the people, and the state of the goal."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from chefbotd.cli.maps.draw import Mark
from chefbotd.cli.maps.live import MapTracker
from chefbotd.client import Client
from chefbotd.mapping.occupancy_grid import OccupancyGrid

Disc = tuple[float, float, float]
"""x, y and radius in metres."""


@dataclass(frozen=True, slots=True)
class Leg:
    """From where the robot stood to a place. ``end`` is the goal's, ``reason`` its sentence.

    ``closest_m`` is the least distance of the robot's outline from anything that it could bump into, as far as its own
    motion led there; ``closest_of_all_m`` counts also who walked up to it.
    """

    place: str
    end: str
    reason: str
    length_m: float
    shortest_m: float
    seconds: float
    ideal_s: float
    closest_m: float
    closest_of_all_m: float
    off_m: float
    off_rad: float
    touched: bool

    @property
    def failure(self) -> str | None:
        """Why this leg does not count as done."""
        if self.end != "reached":
            return f"{self.place}: {self.reason or self.end}"
        if self.touched:
            return f"{self.place}: it touched something"
        return None


@dataclass(frozen=True, slots=True)
class Found:
    """How it found out where it was: after how long, and how far from the truth."""

    seconds: float
    off_m: float
    off_rad: float
    turned: bool


@dataclass(frozen=True, slots=True)
class Served:
    """What came of it."""

    found: Found
    legs: tuple[Leg, ...]
    seconds: float

    @property
    def failures(self) -> tuple[str, ...]:
        """Why it does not count as done; nothing where it does."""
        return tuple(leg.failure for leg in self.legs if leg.failure is not None)


RATE_HZ = 5.0
TOPICS = ("odometry", "map_pose", "navigation", "path", "localization")
ENDS = ("reached", "unreachable", "blocked", "cancelled", "lost", "fault")
ROBOT, PATH, PLACE, SOMEBODY = "bold red", "green", "bold blue", "bold magenta"


@dataclass(slots=True)
class NavigationScene:
    """The newest of each."""

    grid: OccupancyGrid | None = None
    places: tuple[Mark, ...] = ()
    tracker: MapTracker = field(default_factory=MapTracker)
    path: tuple[tuple[float, float], ...] = ()
    discs: tuple[Disc, ...] = ()
    doing: str = ""
    state: str = "idle"
    reason: str = ""
    distance_m: float | None = None
    time_s: float | None = None
    localization: str = "unknown"
    legs: list[Leg] = field(default_factory=list)
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

    def marks(self) -> list[Mark]:
        """What is drawn on the map, the later above the earlier."""
        found = [Mark(x, y, style=PATH, sign="·") for x, y in self.path]
        found += self.places
        found += [Mark(x, y, style=SOMEBODY, sign="o") for x, y, _ in self.discs]
        if (pose := self.tracker.pose) is not None:
            found.append(Mark(pose.x_m, pose.y_m, pose.heading_rad, style=ROBOT))
        return found


Show: TypeAlias = Callable[[NavigationScene], None]


async def listen(robot: Client, scene: NavigationScene, show: Show) -> None:
    """Take in what is told, and show each change of the pose, until cancelled."""
    async with robot.subscribe(TOPICS, max_rate_hz=RATE_HZ) as events:
        async for event in events:
            scene.take_event(event)
            if event.topic in ("odometry", "navigation"):
                show(scene)
