"""A path that is being driven: found, checked, and compared with a new one."""

import math

import numpy as np

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record, replace
from chefbotd.navigation.costmap import Costmap, between_cells_at
from chefbotd.navigation.grid_frame import Floats
from chefbotd.navigation.outline import Footprint
from chefbotd.navigation.path import ESCAPE_M, SPACING_M, Goal, NoPath, Path, Planner, turn_rad
from chefbotd.navigation.steering import TURN_ON_THE_SPOT_RAD, FollowerLimits, FollowState

NEAR_GOAL_M = 0.9
"""So near to a goal that is taken the robot waits. A free place farther from it may be behind a wall."""

AHEAD_M = 1.5
"""So much of a path is looked at for how much room it leaves."""


class Trip(Record, frozen=True):
    """A path and how far it was followed; an interim one leads only near to a goal that something stands on."""

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


def find(
    planner: Planner,
    outline: Footprint,
    costs: Costmap,
    ground: Costmap,
    pose: Pose2D,
    goal: Goal,
) -> Trip | NoPath:
    """A path with what is known now (``costs``); a path only near to the goal where something stands on it.

    What the map alone (``ground``) does not allow is no matter of waiting; ``only_for_now`` tells them apart.
    """
    found = planner(outline, costs, pose, goal)
    if isinstance(found, Path):
        return Trip(found, FollowState())
    on_map = found if costs is ground else planner(outline, ground, pose, goal)
    if isinstance(on_map, NoPath):
        return on_map
    offered = found.nearest
    if offered is None or math.hypot(offered.x_m - goal.x_m, offered.y_m - goal.y_m) > NEAR_GOAL_M:
        return replace(found, only_for_now=True)
    if math.hypot(goal.x_m - pose.x_m, goal.y_m - pose.y_m) > NEAR_GOAL_M:
        near = planner(outline, costs, pose, replace(goal, tolerance_m=math.inf))
        if isinstance(near, Path):
            return Trip(
                replace(near, goal=replace(near.goal, heading_rad=None)), FollowState(), is_interim=True
            )
    told = f"something stands at the goal ({goal.x_m:.2f}, {goal.y_m:.2f})"
    return NoPath(told, offered, only_for_now=True)


def blocked_at(costs: Costmap, path: Path) -> Floats | None:
    """Where (in the grid's frame) a path is blocked first."""
    after_m = blocked_after_m(costs, path)
    return None if after_m is None else path.points_m[round(after_m / SPACING_M)]


def blocked_after_m(costs: Costmap, path: Path) -> float | None:
    """How far along a path the first blocked cell is, but for where the robot itself stands."""
    columns, rows = np.floor(path.points_m / costs.frame.resolution_m).astype(np.int64).T
    along_m = np.flatnonzero(np.isinf(costs.costs[rows, columns])) * SPACING_M
    beyond = along_m[along_m > ESCAPE_M / 2]
    return float(beyond[0]) if len(beyond) else None


def turn_worth(params: FollowerLimits, path: Path, pose: Pose2D) -> float:
    """What it costs to begin with a path: where the robot turns on the spot, the way that it could go meanwhile."""
    turned = turn_rad(pose, path)
    if turned < TURN_ON_THE_SPOT_RAD:
        return 0.0
    stopping_s = (
        params.max_speed_m_s / params.deceleration_m_s2 + params.max_speed_m_s / params.acceleration_m_s2
    )
    seconds = (
        turned / params.max_turn_rad_s + params.max_turn_rad_s / params.turn_acceleration_rad_s2 + stopping_s
    )
    return seconds * params.max_speed_m_s / path.spacing_m


def worth(costs: Costmap, path: Path) -> float:
    """What a path costs."""
    columns, rows = np.floor(path.points_m / costs.frame.resolution_m).astype(np.int64).T
    return float(costs.costs[rows, columns].sum())


def least_room_m(costs: Costmap, path: Path) -> float:
    """The least room beside the outline to what stands, along the next of a path, but for where it begins and ends."""
    points = path.points_m[2 : max(math.ceil(AHEAD_M / path.spacing_m), 3)]
    points = points[: max(len(path.points_m) - 8, 0)]
    if not len(points):
        return math.inf
    apart_m = between_cells_at(costs.standing_m, costs.frame.resolution_m, points)
    return float(apart_m.min()) - costs.inflation.inner_m
