"""Navigation: goals, what becomes of them, and its topics."""

import math
from collections.abc import Callable
from typing import Annotated, Final, Literal, Self

from msgspec import Meta
from pydantic import Field, model_validator

from chefbotd.components.maps.models import GridPartData, grid_part
from chefbotd.components.navigation.algorithms.arrival import ArrivalData
from chefbotd.components.navigation.events import (
    ArrivalChanged,
    CostmapChanged,
    NavigationChanged,
    NavigationData,
    ObstaclesSeen,
    PathChanged,
    PathData,
)
from chefbotd.core.record import Record
from chefbotd.rpc.models import MotionParams, Params
from chefbotd.rpc.topics import Topic, same_names

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
        0.0, ge=0, le=10, description="if the goal is occupied, how far from it the nearest free pose may be"
    )
    max_speed_m_s: float | None = Field(
        None,
        gt=0,
        le=10,
        description="no faster on the way there, also where the robot and its zones would allow it",
    )

    @model_validator(mode="after")
    def _is_one_goal(self) -> Self:
        has_pose = self.x_m is not None and self.y_m is not None
        if has_pose is (self.place is not None) or (self.x_m is None) is not (self.y_m is None):
            raise ValueError("expected either place, or x_m and y_m")
        if self.place is not None and self.heading_rad is not None:
            raise ValueError("a place has a heading already, expected no heading_rad")
        return self


GOAL_ID: Final = Field(
    None,
    min_length=1,
    max_length=64,
    pattern=r"^[^\x00-\x1f\x7f-\x9f]+$",
    description="the client's own; where this id is known already, nothing begins, and its state is the answer",
)


class GoalParams(MotionParams):
    """When to drive to a goal, and when to answer.

    ``wait``: answer when it has ended. A goal that ends with its client also ends if a request that waits is cancelled.
    """

    queue: bool = Field(False, description="true: after the waiting goals; false: they are cancelled")
    wait: bool = False
    goal_id: str | None = GOAL_ID
    on_client_left: Literal["cancel", "keep"] | None = Field(
        None, description="whether the goal ends with its client; if none is given: with wait it does"
    )

    @property
    def ends_with_client(self) -> bool:
        """Whether the goal ends when its client leaves."""
        return self.wait if self.on_client_left is None else self.on_client_left == "cancel"


class NavigateToParams(GoalParams, Waypoint):
    """A goal, and when to answer."""


class FollowWaypointsParams(GoalParams):
    """Goals, to be reached one after the other. ``wait``: answer when the last has ended, or one was not reached."""

    waypoints: list[Waypoint] = Field(min_length=1, max_length=MOST_WAYPOINTS)


class GetGoalParams(Params):
    """A goal by its number, or by the id that a client chose for it."""

    goal: int | None = Field(None, ge=0)
    goal_id: str | None = GOAL_ID

    @model_validator(mode="after")
    def _is_one(self) -> Self:
        if (self.goal is None) is (self.goal_id is None):
            raise ValueError("expected either goal or goal_id")
        return self


class CostmapData(GridPartData, frozen=True, kw_only=True):
    """A part of the costmap of the map in use, at most 80 by 80 cells.

    ``cells`` are ``part_rows`` by ``part_columns`` from (``row``, ``column``) on, the lowest y first. With another
    ``revision`` than before, all that was known is void.
    """

    map: str
    cells: Annotated[
        str, Meta(description="a byte each: 0 free, 100 blocked, else 20 times the cost beyond 1")
    ]


class DynamicObstacleData(Record, frozen=True):
    """Somebody who moves: where in the map, and how fast along its axes."""

    x_m: float
    y_m: float
    vx_m_s: float
    vy_m_s: float


class ObstaclesData(Record, frozen=True):
    """What is seen now and is not on the map: points in it, at most 1000 (``omitted`` are more), and who moves."""

    x_m: tuple[float, ...] = ()
    y_m: tuple[float, ...] = ()
    omitted: int = 0
    dynamic_obstacles: tuple[DynamicObstacleData, ...] = ()


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
    Topic(
        "navigation",
        (NavigationChanged,),
        NavigationData,
        same_names(NavigationData),
        always_known=True,
        for_guests=True,
    ),
    Topic("arrival", (ArrivalChanged,), ArrivalData, same_names(ArrivalData)),
    Topic("path", (PathChanged,), PathData, same_names(PathData), always_known=True, for_guests=True),
)
