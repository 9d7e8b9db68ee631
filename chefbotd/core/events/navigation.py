"""Events of navigation: its state, and the path that it follows. Loads no numpy."""

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record


class NavigationChanged(Record, frozen=True):
    """``state`` is idle, planning, driving, recovering or paused, or how the goal ended, until the next one.

    A goal ends reached, unreachable, blocked, cancelled, lost or fault. ``reason`` is a sentence; ``distance_m`` and
    ``time_s`` are what is left.
    """

    stamp_s: float
    state: str
    goal: int | None
    reason: str
    distance_m: float | None
    time_s: float | None


class CostmapChanged(Record, frozen=True):
    """A part of what it costs to drive through the cells of a map; made only while somebody looks.

    The part's cells are ``part_rows`` by ``part_columns`` from (``row``, ``column``) on: a byte each, row by row from
    the lowest y up, compressed by zlib. 0 is free, 100 blocked, in between 20 times what a cell costs beyond 1. With
    another ``revision`` than before, whatever was known is void.
    """

    stamp_s: float
    map: str
    revision: int
    resolution_m: float
    map_from_grid: Pose2D
    columns: int
    rows: int
    column: int
    row: int
    part_columns: int
    part_rows: int
    cells: bytes


class ObstaclesSeen(Record, frozen=True):
    """What is seen now and is not on the map: points in it, how many more there are, and what moves.

    Of each of ``dynamic_obstacles``: x, y, and its velocity along the map's axes. Made only while somebody looks.
    """

    stamp_s: float
    x_m: tuple[float, ...]
    y_m: tuple[float, ...]
    omitted: int
    dynamic_obstacles: tuple[tuple[float, float, float, float], ...]


class PathChanged(Record, frozen=True):
    """The path that is followed from now on, in the map; without points there is none."""

    stamp_s: float
    x_m: tuple[float, ...]
    y_m: tuple[float, ...]
