"""A map that is being made, and what is done meanwhile: what a screen of it shows."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

from chefbotd.cli.maps.live import LiveMap, MapTracker
from chefbotd.cli.maps.route import Point


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
