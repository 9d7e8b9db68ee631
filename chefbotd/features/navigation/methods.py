"""Navigation: the methods that send the robot somewhere, and its topics."""

import math
from collections.abc import Callable
from typing import Annotated, Final, Protocol, Self

from pydantic import Field, model_validator

from chefbotd.core.events.navigation import CostmapChanged, NavigationChanged, ObstaclesSeen, PathChanged
from chefbotd.features.maps.grid_part import GridPartData, grid_part
from chefbotd.navigation.section import NavigationSection
from chefbotd.rpc.jobs import Progress
from chefbotd.rpc.method import Caller, method
from chefbotd.rpc.models import DONE, Done, NoParams, Params, Result, TopicData
from chefbotd.rpc.roles import Role
from chefbotd.rpc.topics import Topic

MOST_M: Final = 1e4
MOST_WAYPOINTS: Final = 100
Metres = Annotated[float, Field(ge=-MOST_M, le=MOST_M)]


class Waypoint(Params):
    """A pose in the map in use (without a heading any will do), or a place by its name."""

    x_m: Metres | None = None
    y_m: Metres | None = None
    heading_rad: float | None = Field(None, ge=-math.tau, le=math.tau, description="CCW positive")
    place: str | None = Field(None, min_length=1, max_length=100)
    tolerance_m: float = Field(
        0.0,
        ge=0,
        le=10,
        description="if the goal is occupied, how far from it the nearest free pose may be",
    )

    @model_validator(mode="after")
    def _is_one_goal(self) -> Self:
        has_pose = self.x_m is not None and self.y_m is not None
        if has_pose is (self.place is not None) or (self.x_m is None) is not (self.y_m is None):
            raise ValueError("expected either place, or x_m and y_m")
        if self.place is not None and self.heading_rad is not None:
            raise ValueError("a place has a heading already, expected no heading_rad")
        return self


class NavigateToParams(Waypoint):
    """A goal. ``wait``: answer when it has ended, and cancel it if this request is cancelled or its client leaves."""

    queue: bool = Field(False, description="true: after the waiting goals; false: they are cancelled")
    wait: bool = False


class FollowWaypointsParams(Params):
    """Goals, to be reached one after the other. ``wait``: answer when the last has ended, or one was not reached."""

    waypoints: list[Waypoint] = Field(min_length=1, max_length=MOST_WAYPOINTS)
    queue: bool = Field(False, description="true: after the waiting goals; false: they are cancelled")
    wait: bool = False


class GoToPlaceParams(Params):
    """When to drive to a place of the configuration, and when to answer: as for ``navigate_to``."""

    queue: bool = Field(False, description="true: after the waiting goals; false: they are cancelled")
    wait: bool = False


class GoalResult(Result):
    """The goal's number; and, after waiting, how it ended, with a sentence."""

    goal: int
    end: str | None = Field(
        None, description="reached, unreachable, blocked, cancelled, lost or fault; null: it was accepted"
    )
    reason: str = ""


class PlanResult(Result):
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


class NavigationData(TopicData):
    """What navigation does; ``reason`` is a sentence."""

    state: str = Field(
        default="idle",
        description="idle, planning, driving, recovering or paused; or how the last goal ended: reached, unreachable, "
        "blocked, cancelled, lost or fault",
    )
    goal: int | None = None
    reason: str = ""
    distance_m: float | None = Field(default=None, description="still to drive")
    time_s: float | None = Field(default=None, description="how long that takes without obstacles")


class PathData(TopicData):
    """The path that the robot follows, in the map; without points there is none."""

    x_m: tuple[float, ...] = ()
    y_m: tuple[float, ...] = ()


class CostmapData(GridPartData):
    """A part of the costmap of the map in use, at most 80 by 80 cells.

    ``cells`` are ``part_rows`` by ``part_columns`` from (``row``, ``column``) on, the lowest y first. With another
    ``revision`` than before, all that was known is void.
    """

    map: str
    cells: str = Field(description="a byte each: 0 free, 100 blocked, else 20 times the cost beyond 1")


class DynamicObstacleData(TopicData):
    """Somebody who moves: where in the map, and how fast along its axes."""

    x_m: float
    y_m: float
    vx_m_s: float
    vy_m_s: float


class ObstaclesData(TopicData):
    """What is seen now and is not on the map: points in it, at most 1000 (``omitted`` are more), and who moves."""

    x_m: tuple[float, ...] = ()
    y_m: tuple[float, ...] = ()
    omitted: int = 0
    dynamic_obstacles: tuple[DynamicObstacleData, ...] = ()


class Navigation(Protocol):
    """What drives to goals. Each raises ``chefbotd.core.commands.Refused`` where it is not done."""

    async def navigate_to(self, waypoints: list[Waypoint], *, queue: bool) -> list[int]:
        """Accept goals; their numbers."""
        ...

    async def wait(self, goals: list[int], progress: Progress) -> GoalResult:
        """Wait for the end of these; that of the first that is not reached, or of the last."""
        ...

    async def plan_to(self, waypoint: Waypoint) -> PlanResult:
        """What would be driven."""
        ...

    def cancel(self, reason: str) -> None:
        """End all goals."""
        ...

    def pause(self, by: str) -> None:
        """Stand until ``resume``; ``by`` says who wants it."""
        ...

    def resume(self) -> None:
        """Go on."""
        ...


class NavigationMethods:
    """The methods of this feature; ``section`` names the robot's own places."""

    def __init__(self, navigation: Navigation, section: NavigationSection) -> None:
        self._navigation, self._section = navigation, section

    @method(role=Role.DRIVE, moves=True)
    async def navigate_to(self, caller: Caller, params: NavigateToParams, progress: Progress) -> GoalResult:
        """Drive to a pose in the map in use, or to a place."""
        return await self._begun([params], progress, queue=params.queue, wait=params.wait)

    @method(role=Role.DRIVE, moves=True)
    async def follow_waypoints(
        self, caller: Caller, params: FollowWaypointsParams, progress: Progress
    ) -> GoalResult:
        """Drive to several goals in order; the answer is the last goal's number, or how it ended."""
        return await self._begun(params.waypoints, progress, queue=params.queue, wait=params.wait)

    @method(role=Role.DRIVE, moves=True)
    async def go_home(self, caller: Caller, params: GoToPlaceParams, progress: Progress) -> GoalResult:
        """Drive to the place navigation.home_place (home) of the map in use."""
        return await self._to_place(self._section.home_place, params, progress)

    @method(role=Role.DRIVE, moves=True)
    async def dock(self, caller: Caller, params: GoToPlaceParams, progress: Progress) -> GoalResult:
        """Drive to the place navigation.dock_place (dock) of the map in use."""
        return await self._to_place(self._section.dock_place, params, progress)

    async def _to_place(self, place: str, params: GoToPlaceParams, progress: Progress) -> GoalResult:
        waypoint = Waypoint(place=place)
        return await self._begun([waypoint], progress, queue=params.queue, wait=params.wait)

    async def _begun(
        self, waypoints: list[Waypoint], progress: Progress, *, queue: bool, wait: bool
    ) -> GoalResult:
        goals = await self._navigation.navigate_to(waypoints, queue=queue)
        return await self._navigation.wait(goals, progress) if wait else GoalResult(goal=goals[-1])

    @method(role=Role.OBSERVE)
    async def plan_to(self, caller: Caller, params: Waypoint, progress: Progress) -> PlanResult:
        """Plan a path without driving: whether there is one, its length, and the time it takes."""
        return await self._navigation.plan_to(params)

    @method(role=Role.OBSERVE)
    def cancel_navigation(self, caller: Caller, params: NoParams) -> Done:
        """End all goals; the robot comes to rest."""
        self._navigation.cancel(f"by {caller.session}")
        return DONE

    @method(role=Role.OBSERVE)
    def pause_navigation(self, caller: Caller, params: NoParams) -> Done:
        """Stop the robot, and keep its goals."""
        self._navigation.pause(str(caller.session))
        return DONE

    @method(role=Role.DRIVE, moves=True)
    def resume_navigation(self, caller: Caller, params: NoParams) -> Done:
        """Continue with the goals from the robot's present pose."""
        self._navigation.resume()
        return DONE


def _path(event: PathChanged | None) -> PathData:
    return PathData() if event is None else PathData(x_m=event.x_m, y_m=event.y_m)


def _costmap(event: CostmapChanged) -> CostmapData:
    return CostmapData(**grid_part(event), map=event.map)


def _obstacles(event: ObstaclesSeen) -> ObstaclesData:
    moving = tuple(
        DynamicObstacleData(x_m=x, y_m=y, vx_m_s=vx, vy_m_s=vy) for x, y, vx, vy in event.dynamic_obstacles
    )
    return ObstaclesData(x_m=event.x_m, y_m=event.y_m, omitted=event.omitted, dynamic_obstacles=moving)


def shown_topics(
    costmap: Callable[[bool], None] | None = None, obstacles: Callable[[bool], None] | None = None
) -> tuple[Topic, ...]:
    """What is made only for whoever looks; each is called when somebody begins to, and when nobody does any more."""
    return (
        Topic("costmap", (CostmapChanged,), CostmapData, _costmap, on_demand=True, demanded=costmap),
        Topic("obstacles", (ObstaclesSeen,), ObstaclesData, _obstacles, on_demand=True, demanded=obstacles),
    )


TOPICS = (
    Topic("navigation", (NavigationChanged,), NavigationData, NavigationData.of, always_known=True),
    Topic("path", (PathChanged,), PathData, _path, always_known=True),
)
