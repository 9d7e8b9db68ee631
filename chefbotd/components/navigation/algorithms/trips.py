"""A path that is being driven: found, checked, and replaced when it is blocked or a new one is better."""

import math
from enum import StrEnum
from typing import Final

import numpy as np

from chefbotd.components.navigation.algorithms.arcs import CREEP_M_S, FULL_SPEED_ROOM_M
from chefbotd.components.navigation.algorithms.costmap import Costmap, between_cells_at
from chefbotd.components.navigation.algorithms.evade import is_in_the_way
from chefbotd.components.navigation.algorithms.grid import Floats
from chefbotd.components.navigation.algorithms.interface import NavigationParameters, StepInput
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.path import (
    ESCAPE_M,
    SPACING_M,
    Goal,
    NoPath,
    Path,
    Planner,
    turn_rad,
)
from chefbotd.components.navigation.algorithms.recovery import DETOUR_S
from chefbotd.components.navigation.algorithms.steering import (
    TURN_ON_THE_SPOT_RAD,
    FollowerLimits,
    FollowState,
    Phase,
)
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence

NEAR_GOAL_M = 0.9
"""The robot waits so near to an occupied goal. A free place farther from the goal may be behind a wall."""

AHEAD_M = 1.5
"""Two paths are compared for the room that they leave along so much of them."""

REPLAN_S: Final = 1.0
BETTER_SHARE: Final = 0.85
"""A new path is taken if it costs no more than this share of the present one, or if that is blocked."""

TURN_BACK_M: Final = 1.0
"""If there is no other path, the robot drives on until it is so near to what blocks the present one."""

TURN_S = 4.0
"""The robot does not stop to turn to a better path if a person will pass there within this time."""

LONGER_M = 0.6
"""A detour that is no longer than this is taken at once."""

CLEARER_M = 0.02
"""A path with so much more room than the present one, where that is tight, is better."""


class Trip(Record, frozen=True):
    """A path and how far it was followed; an interim one leads only near to a goal that is occupied."""

    path: Path
    follow: FollowState
    is_interim: bool = False

    @property
    def left(self) -> Path:
        """What is still to be driven."""
        index = self.follow.index
        return replace(
            self.path, points_m=self.path.points_m[index:], heading_rad=self.path.heading_rad[index:]
        )


def plan_now(
    planner: Planner, outline: Footprint, costs: Costmap, ground: Costmap, pose: Pose2D, goal: Goal
) -> Path | NoPath:
    """A path by what is known now (``costs``).

    Without one, ``only_for_now`` says that the map alone (``ground``) would allow one; else the reason is the map's.
    """
    path = planner(outline, costs, pose, goal)
    if isinstance(path, Path) or costs is ground:
        return path
    on_map = planner(outline, ground, pose, goal)
    return on_map if isinstance(on_map, NoPath) else replace(path, only_for_now=True)


def find(
    planner: Planner, outline: Footprint, costs: Costmap, ground: Costmap, pose: Pose2D, goal: Goal
) -> Trip | NoPath:
    """A path by what is known now (``costs``); only near to the goal if that is occupied.

    Without a path, ``only_for_now`` says that the map alone (``ground``) would allow one.
    """
    path = plan_now(planner, outline, costs, ground, pose, goal)
    if isinstance(path, Path):
        return Trip(path, FollowState())
    offered = path.nearest
    is_far = offered is None or math.hypot(offered.x_m - goal.x_m, offered.y_m - goal.y_m) > NEAR_GOAL_M
    if is_far or not path.only_for_now:
        return path
    if math.hypot(goal.x_m - pose.x_m, goal.y_m - pose.y_m) > NEAR_GOAL_M:
        near = planner(outline, costs, pose, replace(goal, tolerance_m=math.inf))
        if isinstance(near, Path):
            return Trip(
                replace(near, goal=replace(near.goal, heading_rad=None)), FollowState(), is_interim=True
            )
    why = stands_at_goal(goal)
    return NoPath(why, offered, only_for_now=True)


def stands_at_goal(goal: Goal) -> Sentence:
    """Why a goal is not reached that is not free."""
    return Sentence(
        "navigation.stands_at_goal",
        "something stands at the goal ({x_m:.2f}, {y_m:.2f})",
        x_m=goal.x_m,
        y_m=goal.y_m,
    )


def blocked_at(costs: Costmap, path: Path) -> Floats | None:
    """Where (in the grid's frame) a path is blocked first."""
    after_m = blocked_after_m(costs, path)
    return None if after_m is None else path.points_m[round(after_m / SPACING_M)]


def blocked_after_m(costs: Costmap, path: Path) -> float | None:
    """How far along a path the first blocked cell is, apart from the robot's own place."""
    columns, rows = np.floor(path.points_m / costs.frame.resolution_m).astype(np.int64).T
    along_m = np.flatnonzero(np.isinf(costs.costs[rows, columns])) * SPACING_M
    beyond = along_m[along_m > ESCAPE_M / 2]
    return float(beyond[0]) if len(beyond) else None


def turn_worth(params: FollowerLimits, path: Path, pose: Pose2D) -> float:
    """The cost of turning on the spot to begin with a path: that of the distance that it could drive meanwhile."""
    turned = turn_rad(pose, path)
    if turned < TURN_ON_THE_SPOT_RAD:
        return 0.0
    speed_m_s, turn_rad_s = params.max_speed_m_s, params.max_turn_rad_s
    stopping_s = speed_m_s / params.deceleration_m_s2 + speed_m_s / params.acceleration_m_s2
    turning_s = turned / turn_rad_s + turn_rad_s / params.turn_acceleration_rad_s2 + stopping_s
    return turning_s * speed_m_s / path.spacing_m


def worth(costs: Costmap, path: Path) -> float:
    """What a path costs."""
    columns, rows = np.floor(path.points_m / costs.frame.resolution_m).astype(np.int64).T
    return float(costs.costs[rows, columns].sum())


def least_room_m(costs: Costmap, path: Path) -> float:
    """The least room beside the outline to standing obstacles, along the next part of a path without its ends."""
    points = path.points_m[2 : max(math.ceil(AHEAD_M / path.spacing_m), 3)]
    points = points[: max(len(path.points_m) - 8, 0)]
    if not len(points):
        return math.inf
    apart_m = between_cells_at(costs.standing_m, costs.frame.resolution_m, points)
    return float(apart_m.min()) - costs.inflation.inner_m


class Choice(StrEnum):
    """What to do about the present path."""

    KEEP = "keep"
    TAKE_NEW = "take_new"
    STUCK = "stuck"


def is_due(params: NavigationParameters, trip: Trip, planned_s: float, now_s: float) -> bool:
    """Whether to plan again; at the goal it is too late."""
    at_goal = trip.follow.phase in (Phase.APPROACHING, Phase.FINAL_TURN, Phase.DONE)
    return not at_goal and now_s - planned_s >= REPLAN_S


def choice(
    params: NavigationParameters,
    costs: Costmap,
    trip: Trip,
    other: Trip | NoPath,
    inputs: StepInput,
    surroundings: Surroundings,
) -> Choice:
    """Compare another trip, found with these costs, to what is left of the present one."""
    left = trip.left
    blocked_m = blocked_after_m(costs, left)
    if isinstance(other, NoPath):
        is_stuck = blocked_m is not None and blocked_m < TURN_BACK_M
        return Choice.STUCK if is_stuck else Choice.KEEP
    if blocked_m is not None or other.is_interim != trip.is_interim:
        return Choice.TAKE_NEW
    turn = turn_worth(params.follower, other.path, inputs.pose)
    is_better = worth(costs, other.path) + turn < BETTER_SHARE * worth(costs, left)
    if turn == 0.0 and not is_better:
        is_better = _is_clearer(costs, other.path, left)
    if not is_better or trip.is_interim:
        return Choice.KEEP
    has_to_wait = turn > 0 and is_in_the_way(params.outline, surroundings, TURN_S)
    return Choice.KEEP if has_to_wait else Choice.TAKE_NEW


class Waiting(Record, frozen=True):
    """Since when, and until when, the robot waits for a person instead of driving round him; why, as a sentence."""

    since_s: float
    until_s: float
    reason: str


def waiting(
    params: NavigationParameters, world: WorldModel, trip: Trip, other: Trip, since_s: float, now_s: float
) -> Waiting | None:
    """Whether to wait for a person on the trip, instead of taking the longer path of the other one.

    It waits as long as the detour would take, counted from ``since_s``.
    """
    place = blocked_at(world.planned_costs, trip.left)
    longer_m = other.path.length_m - trip.left.length_m
    until_s = since_s + min(longer_m / params.follower.max_speed_m_s, DETOUR_S)
    if place is None or longer_m < LONGER_M or now_s >= until_s or not world.may_leave(place, now_s):
        return None
    point = world.frame.pose_to_map(Pose2D(float(place[0]), float(place[1])))
    where = f"({point.x_m:.2f}, {point.y_m:.2f})"
    reason = Sentence(
        "navigation.waits_for_somebody",
        "waiting for somebody at {where} to go on: the way round is {longer_m:.1f} m longer",
        where=where,
        longer_m=longer_m,
    )
    return Waiting(since_s, until_s, reason)


def _is_clearer(costs: Costmap, new: Path, left: Path) -> bool:
    """Whether a path leaves more room to standing obstacles, if the present one is tight."""
    tight_m = costs.inflation.tight_m
    has_m = least_room_m(costs, left)
    return has_m < tight_m and min(least_room_m(costs, new), tight_m) > has_m + CLEARER_M


def duration_s(params: FollowerLimits, path: Path, grid_from_base: Pose2D, costs: Costmap | None) -> float:
    """The time to stand at the end of a path with the goal's heading."""
    if len(path.points_m) < 2:
        return 0.0
    lengths = np.hypot(*np.diff(path.points_m, axis=0).T)
    most_m_s = min(params.max_speed_m_s, path.goal.max_speed_m_s or math.inf)
    speed = np.full(len(lengths), most_m_s)
    if costs is not None:
        columns, rows = np.floor(path.points_m[1:] / path.frame.resolution_m).astype(np.int64).T
        room = np.maximum(costs.distance_m[rows, columns] - costs.inflation.inner_m, 0.0)
        share = np.minimum(room / FULL_SPEED_ROOM_M, 1.0)
        roomy = CREEP_M_S + (params.max_speed_m_s - CREEP_M_S) * share
        speed = np.minimum.reduce((speed, roomy, costs.speed_limit_m_s[rows, columns]))
    first = float(path.heading_rad[min(4, len(path.heading_rad) - 1)])
    turned = abs(wrap_angle(first - grid_from_base.heading_rad))
    if path.goal.heading_rad is not None:
        end = path.frame.pose_to_grid(Pose2D(path.goal.x_m, path.goal.y_m, path.goal.heading_rad))
        turned += abs(wrap_angle(end.heading_rad - float(path.heading_rad[-1])))
    starting_s = params.max_speed_m_s / params.acceleration_m_s2
    return float((lengths / speed).sum()) + turned / params.max_turn_rad_s + starting_s
