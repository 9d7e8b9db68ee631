"""Going to look whether a thing of the map is still there, where it alone is in the way of a goal.

The robot drives to a place beside the thing from where its lidar sees all of it; on the way it sees it from others.
"""

import math
from typing import Final

import numpy as np

from chefbotd.components.navigation.algorithms.costmap import Costmap
from chefbotd.components.navigation.algorithms.grid import Floats
from chefbotd.components.navigation.algorithms.interface import StepInput
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.path import Goal, Path, Planner
from chefbotd.components.navigation.algorithms.steering import FollowState
from chefbotd.components.navigation.algorithms.trips import Trip
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence

AWAY_M: Final = 0.4
"""The robot looks from so far beside a thing."""

BEARINGS: Final = 12
"""It may look from so many places around it."""

LOOKS_S: Final = 2.0
"""It looks for so long from one place."""

MOST_LOOKS: Final = 4
"""It goes to look so many times for a goal."""

MOST_THINGS: Final = 40
"""So many things are asked for, those nearest to the straight line to the goal first."""

ELSEWHERE_M: Final = 0.4
"""Places from which it looks are so far apart."""


class Look(Record, frozen=True):
    """The thing it goes to look at and its place in the map; since when it looks, and where it did for this goal."""

    thing: int | None = None
    place: str = ""
    since_s: float | None = None
    looked_from: tuple[tuple[float, float], ...] = ()
    standing: tuple[str, ...] = ()

    @property
    def reason(self) -> str:
        """What it does."""
        return Sentence(
            "navigation.goes_to_look",
            "the map has something at {place}: going to look whether it is still there",
            place=self.place,
        )


def in_the_way(
    world: WorldModel, planner: Planner, outline: Footprint, inputs: StepInput, goal: Goal
) -> int | None:
    """The first thing of the map on the way to a goal that could be reached without such things; None: no such thing.

    What the lidar sees to be there is none of them.
    """
    things = world.things
    pose = world.frame.pose_to_grid(inputs.pose)
    end = world.frame.to_grid(np.array([[goal.x_m, goal.y_m]]))[0]
    away_m = _from_line_m(things.centers_m, np.array([pose.x_m, pose.y_m]), end) - things.radius_m
    doubtful = [int(k) for k in np.argsort(away_m)[:MOST_THINGS] if not world.is_there(int(k))]
    if not doubtful:
        return None
    path = planner(outline, world.ground_without(np.array(doubtful)), inputs.pose, goal)
    return _first_on(path, world, doubtful) if isinstance(path, Path) else None


def _from_line_m(points: Floats, begin: Floats, end: Floats) -> Floats:
    along = end - begin
    share = np.clip((points - begin) @ along / max(float(along @ along), 1e-9), 0, 1)
    away_m: Floats = np.hypot(*(points - begin - share[:, None] * along).T)
    return away_m


def _first_on(path: Path, world: WorldModel, doubtful: list[int]) -> int | None:
    blocked = np.isinf(_along(world.ground, path.points_m))
    for x_m, y_m in path.points_m[blocked]:
        away_m = [_apart_m(world, k, x_m, y_m) for k in doubtful]
        return doubtful[int(np.argmin(away_m))]
    last = path.points_m[-1]  # what is at the goal: a guard would stop the robot for it
    away_m = [_apart_m(world, k, last[0], last[1]) for k in doubtful]
    return doubtful[int(np.argmin(away_m))]


def _apart_m(world: WorldModel, thing: int, x_m: float, y_m: float) -> float:
    cells = (world.things.cells[world.things.thing == thing, ::-1] + 0.5) * world.frame.resolution_m
    return float(np.hypot(cells[:, 0] - x_m, cells[:, 1] - y_m).min())


def _along(costs: Costmap, points_m: Floats) -> Floats:
    columns, rows = np.floor(points_m / costs.frame.resolution_m).astype(np.int64).T
    values: Floats = costs.costs[rows, columns].astype(np.float64)
    return values


def look_out(
    world: WorldModel, planner: Planner, outline: Footprint, inputs: StepInput, thing: int, look: Look
) -> Trip | None:
    """The way to the nearest place from where to look at a thing; None: there is none that is new."""
    costs, frame = world.planned_costs, world.frame
    pose = frame.pose_to_grid(inputs.pose)
    ring_m = world.things.radius_m[thing] + outline.outer_radius_m + AWAY_M
    bearings = math.tau / BEARINGS * np.arange(BEARINGS)
    places = world.things.centers_m[thing] + ring_m * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    used = np.array([(pose.x_m, pose.y_m), *look.looked_from])
    apart_m = np.hypot(*(places[:, None, :] - used[None, :, :]).transpose(2, 0, 1)).min(axis=1)
    for k in np.argsort(np.hypot(places[:, 0] - pose.x_m, places[:, 1] - pose.y_m)):
        cell = frame.cell(float(places[k, 0]), float(places[k, 1]))
        if apart_m[k] < ELSEWHERE_M or cell is None or math.isinf(costs.costs[cell]):
            continue
        x_m, y_m = frame.to_map(places[[k]])[0]
        path = planner(outline, costs, inputs.pose, Goal(float(x_m), float(y_m)))
        if isinstance(path, Path):
            return Trip(path, FollowState(), is_interim=True)
    return None


def place_of(world: WorldModel, thing: int) -> str:
    """Where a thing is in the map."""
    x_m, y_m = world.frame.to_map(world.things.centers_m[[thing]])[0]
    return f"({x_m:.2f}, {y_m:.2f})"
