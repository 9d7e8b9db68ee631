"""The messages of the skill ``navigation``. The daemon's side loads neither numpy nor a compiler."""

from pathlib import Path
from typing import Final, TypeAlias

import msgspec

from chefbotd.core.parameters import Parameters
from chefbotd.worker.messages import Message

SKILL: Final = "navigation"


class NavigationSkillParameters(Parameters):
    """What the daemon tells the skill when it starts it. The robot's outline is a circle or a box about its origin.

    ``cameras`` are the depth cameras whose scans count beside those by which localization finds the way.
    """

    folder: Path
    radius_m: float | None
    half_length_m: float
    half_width_m: float
    max_speed_m_s: float
    cameras: tuple[str, ...] = ()


class GoalAsked(Message, frozen=True, tag="goal"):
    """A goal in the map in use, and the number that it has in the daemon."""

    number: int
    x_m: float
    y_m: float
    heading_rad: float | None
    tolerance_m: float


# Requests


class NavigateTo(Message, frozen=True, tag="navigate_to"):
    """Drive to these, one after the other; goals before them end, unless ``queue``."""

    goals: tuple[GoalAsked, ...]
    queue: bool


class KeepGoals(Message, frozen=True, tag="keep_goals"):
    """Of all goals only these, by the daemon's numbers, are left; it has told how the others ended."""

    numbers: tuple[int, ...]


class Pause(Message, frozen=True, tag="pause"):
    """Stand until ``Resume``; ``reason`` says why."""

    reason: str


class Resume(Message, frozen=True, tag="resume"):
    """Go on."""


class PlanTo(Message, frozen=True, tag="plan_to"):
    """Tell what would be driven."""

    goal: GoalAsked


class Show(Message, frozen=True, tag="show"):
    """Tell what people look at, from now on or no more; all of the costs, where somebody begins to look."""

    costmap: bool
    obstacles: bool


class CheckMap(Message, frozen=True, tag="check_map"):
    """Tell whether there is something wrong with the map in use."""


NavigationRequest: TypeAlias = NavigateTo | KeepGoals | Pause | Resume | PlanTo | Show | CheckMap

# Told, and answered


class Taken(Message, frozen=True, tag="taken"):
    """It was done."""


class MapChecked(Message, frozen=True, tag="map_checked"):
    """Why nobody drives on the map in use; empty where nothing is wrong with it."""

    problem: str


class Planned(Message, frozen=True, tag="planned"):
    """What would be driven; without a way ``reason`` says why, and ``nearest`` is a free pose near the goal."""

    possible: bool
    reason: str
    length_m: float
    time_s: float
    x_m: tuple[float, ...]
    y_m: tuple[float, ...]
    nearest: tuple[float, float, float] | None


class GoalEnded(Message, frozen=True, tag="goal_ended"):
    """A goal's end, with a sentence."""

    number: int
    end: str
    reason: str


class Stepped(Message, frozen=True, tag="stepped"):
    """What navigation does, and what it wishes the robot to do now (``twist``: m/s and rad/s; None: nothing).

    ``path`` is told when it is another one than before: x and y in the map, without points where there is none.
    """

    stamp_s: float
    twist: tuple[float, float] | None
    state: str
    goal: int | None
    reason: str
    distance_m: float | None
    time_s: float | None
    ended: tuple[GoalEnded, ...]
    path: tuple[tuple[float, ...], tuple[float, ...]] | None


class CostsShown(Message, frozen=True, tag="costs"):
    """A patch of the costs, as ``chefbotd.core.events.navigation.CostmapChanged``; ``cells`` by zlib."""

    stamp_s: float
    map: str
    revision: int
    resolution_m: float
    origin: tuple[float, float, float]
    columns: int
    rows: int
    column: int
    row: int
    part_columns: int
    part_rows: int
    cells: bytes


class ObstaclesShown(Message, frozen=True, tag="obstacles"):
    """What is not on the map: points, and who moves (x, y, and the velocity along the map's axes)."""

    stamp_s: float
    x_m: tuple[float, ...]
    y_m: tuple[float, ...]
    omitted: int
    movers: tuple[tuple[float, float, float, float], ...]


NavigationTold: TypeAlias = Stepped | CostsShown | ObstaclesShown

REQUEST: Final = msgspec.msgpack.Decoder(NavigationRequest)
TOLD: Final = msgspec.msgpack.Decoder(NavigationTold)
PLANNED: Final = msgspec.msgpack.Decoder(Planned)
MAP_CHECKED: Final = msgspec.msgpack.Decoder(MapChecked)
