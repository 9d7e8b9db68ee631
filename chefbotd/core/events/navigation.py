"""What navigation does, and the path that it follows. Loads no numpy."""

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


class PathChanged(Record, frozen=True):
    """The path that is followed from now on, in the map; without points there is none."""

    stamp_s: float
    x_m: tuple[float, ...]
    y_m: tuple[float, ...]
