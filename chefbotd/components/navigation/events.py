"""Events of navigation: its state, and the path that it follows. Loads no numpy."""

from enum import StrEnum
from typing import Annotated, ClassVar

from msgspec import Meta

from chefbotd.components.navigation.algorithms.arrival import ArrivalData, ArrivalState
from chefbotd.core.grid_patch import GridPatch
from chefbotd.core.record import LogLine, Record, state_line


class GoalCause(StrEnum):
    """Why a goal ended that navigation itself did not end; stable names, for programs."""

    ASKED = "asked"
    REPLACED = "replaced"
    STOPPED = "stopped"
    EARLIER_GOAL = "earlier_goal"
    REQUEST_CANCELLED = "request_cancelled"
    CLIENT_LEFT = "client_left"
    CONTROL_LOST = "control_lost"
    NOT_ARMED = "not_armed"
    REFUSED = "refused"
    WORKER_LOST = "worker_lost"
    MAP_CHANGED = "map_changed"


class NavigationData(Record, frozen=True):
    """The state of navigation; ``reason`` is a sentence."""

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
    cause: Annotated[GoalCause | None, Meta(description="of the end, as in the answer of get_goal")] = None


class NavigationChanged(NavigationData, frozen=True, kw_only=True):
    """Navigation's state or its progress has changed."""

    retained: ClassVar[bool] = True

    stamp_s: float

    def log_line(self) -> LogLine:
        """The line in the log."""
        return state_line("navigation", self.state, self.reason)


class CostmapChanged(GridPatch, frozen=True):
    """A part of the costs of driving through the cells of a map; published only while a client subscribes.

    0 is free, 100 is blocked; between them, 20 times what a cell costs beyond 1. Another ``revision`` than before makes
    all earlier parts void.
    """

    map: str


class ObstaclesSeen(Record, frozen=True):
    """Obstacles that are not on the map: points, how many more there are, and those that move.

    Each of ``dynamic_obstacles`` is x, y, and its velocity along the map's axes. Published while a client subscribes.
    """

    stamp_s: float
    x_m: tuple[float, ...]
    y_m: tuple[float, ...]
    omitted: int
    dynamic_obstacles: tuple[tuple[float, float, float, float], ...]


class PathData(Record, frozen=True):
    """The robot's path in the map; without points it has none."""

    x_m: tuple[float, ...] = ()
    y_m: tuple[float, ...] = ()


class PathChanged(PathData, frozen=True, kw_only=True):
    """A new path is followed."""

    drawn_as: ClassVar[str] = "path"

    stamp_s: float


class ActiveGoal(Record, frozen=True):
    """A goal that has not ended, in the map in use; without a heading any will do."""

    goal: int
    x_m: float
    y_m: float
    heading_rad: float | None = None
    goal_id: str | None = None


class GoalList(Record, frozen=True):
    """The goals that have not ended, in the order in which they are driven to."""

    goals: tuple[ActiveGoal, ...] = ()


class GoalResult(Record, frozen=True):
    """The goal's number and, if it has ended, how, with a sentence and the cause. ``by`` names who ended it."""

    goal: int
    end: Annotated[
        str | None,
        Meta(description="reached, unreachable, blocked, cancelled, lost or fault; null: it was accepted"),
    ] = None
    reason: str = ""
    cause: Annotated[
        GoalCause | None,
        Meta(description="why it was ended; null: navigation itself ended it, or nobody did"),
    ] = None
    by: str = ""
    goal_id: str | None = None
    arrival: Annotated[
        ArrivalState | None,
        Meta(description="what the topic arrival says of a goal that was reached; null: nothing"),
    ] = None
    off_m: Annotated[float | None, Meta(description="the same")] = None


class ArrivalChanged(ArrivalData, frozen=True, kw_only=True):
    """A goal that was reached is doubted, confirmed, or found to be wrong: so was the pose of then."""

    stamp_s: float


class GoalReport(GoalResult, frozen=True):
    """A goal, also after its end. ``state`` is ``accepting``, ``waiting``, as in the topic navigation, or ``ended``."""

    state: str = "ended"


class PlanResult(Record, frozen=True):
    """The path that would be driven. Without one, ``reason`` says why, and there may be a free pose near the goal.

    ``only_for_now``: without what was seen since the map was made there would be a path.
    """

    possible: bool
    reason: str = ""
    length_m: float | None = None
    time_s: float | None = None
    x_m: tuple[float, ...] = ()
    y_m: tuple[float, ...] = ()
    nearest_x_m: float | None = None
    nearest_y_m: float | None = None
    nearest_heading_rad: float | None = None
    only_for_now: bool = False
