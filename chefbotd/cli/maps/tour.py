"""The state of a map that is being made, for the screen that shows it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from chefbotd.cli.maps.live import LiveMap, MapTracker
from chefbotd.cli.maps.route import Point
from chefbotd.client import Client


@dataclass(slots=True)
class Tour:
    """How far it is: the map, the robot in it, and the points still to go to."""

    live: LiveMap = field(default_factory=LiveMap)
    tracker: MapTracker = field(default_factory=MapTracker)
    points: tuple[Point, ...] = ()
    doing: str = ""
    state: str = ""
    fit: float = 0.0
    loops: int = 0
    keyframes: int = 0
    driven_s: float = 0.0


Show: TypeAlias = Callable[[Tour], None]


TOPICS = ("map", "map_pose", "mapping", "odometry")


async def listen(robot: Client, tour: Tour, show: Show) -> None:
    """Take in what is told of the map, and show each change, until cancelled.

    One that begins in mid-mapping sees the map after ten seconds at most, when it is told as a whole again.
    """
    async with robot.subscribe(TOPICS, policy="ordered") as events:
        async for event in events:
            take_event(tour, event)
            if event.topic == "map":
                show(tour)


def take_event(tour: Tour, event: Any) -> None:
    """Take in an event of these topics."""
    if event.topic == "odometry":
        tour.tracker.take_odometry(event.stamp_s, event.data)
    elif event.topic == "map_pose":
        tour.tracker.take_map_pose(event.stamp_s, event.data)
        tour.state, tour.fit = event.data.state, event.data.fit
    elif event.topic == "mapping":
        tour.loops, tour.keyframes = event.data.loops, event.data.keyframes
    else:
        tour.live.take_part(event.data)
