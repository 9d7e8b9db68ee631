"""Events of navigation: its state, and the path that it follows. Loads no numpy."""

from typing import Annotated, ClassVar

from msgspec import Meta

from chefbotd.core.grid_patch import GridPatch
from chefbotd.core.record import LogLine, Record, state_line


class NavigationData(Record, frozen=True):
    """What navigation does; ``reason`` is a sentence."""

    state: Annotated[
        str,
        Meta(
            description="idle, planning, driving, recovering or paused; or how the last goal ended: reached, "
            "unreachable, blocked, cancelled, lost or fault"
        ),
    ] = "idle"
    goal: int | None = None
    reason: str = ""
    distance_m: Annotated[float | None, Meta(description="still to drive")] = None
    time_s: Annotated[float | None, Meta(description="how long that takes without obstacles")] = None


class NavigationChanged(NavigationData, frozen=True, kw_only=True):
    """Navigation does something else, or is nearer to its goal."""

    retained: ClassVar[bool] = True

    stamp_s: float

    def log_line(self) -> LogLine:
        """What the log says of it."""
        return state_line("navigation", self.state, self.reason)


class CostmapChanged(GridPatch, frozen=True):
    """A part of what it costs to drive through the cells of a map; made only while somebody looks.

    0 is free, 100 blocked, in between 20 times what a cell costs beyond 1. With another ``revision`` than before,
    whatever was known is void.
    """

    map: str


class ObstaclesSeen(Record, frozen=True):
    """What is seen now and is not on the map: points in it, how many more there are, and what moves.

    Of each of ``dynamic_obstacles``: x, y, and its velocity along the map's axes. Made only while somebody looks.
    """

    stamp_s: float
    x_m: tuple[float, ...]
    y_m: tuple[float, ...]
    omitted: int
    dynamic_obstacles: tuple[tuple[float, float, float, float], ...]


class PathData(Record, frozen=True):
    """The path that the robot follows, in the map; without points there is none."""

    x_m: tuple[float, ...] = ()
    y_m: tuple[float, ...] = ()


class PathChanged(PathData, frozen=True, kw_only=True):
    """The path that is followed from now on."""

    stamp_s: float


class GoalResult(Record, frozen=True):
    """The goal's number; and, after waiting, how it ended, with a sentence."""

    goal: int
    end: Annotated[
        str | None,
        Meta(description="reached, unreachable, blocked, cancelled, lost or fault; null: it was accepted"),
    ] = None
    reason: str = ""


class PlanResult(Record, frozen=True):
    """What would be driven. Where nothing can be, ``reason`` says why, and there may be a free pose near the goal."""

    possible: bool
    reason: str = ""
    length_m: float | None = None
    time_s: float | None = None
    x_m: tuple[float, ...] = ()
    y_m: tuple[float, ...] = ()
    nearest_x_m: float | None = None
    nearest_y_m: float | None = None
    nearest_heading_rad: float | None = None
