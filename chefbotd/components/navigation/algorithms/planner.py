"""Plans a checked path from the robot's pose to a goal, or gives the reason why there is none."""

import math
from typing import Final

import numpy as np
from scipy import ndimage

from chefbotd.components.navigation.algorithms.costmap import Costmap
from chefbotd.components.navigation.algorithms.goal_room import wall_before_goal
from chefbotd.components.navigation.algorithms.grid import Flags, Floats, GridFrame, Singles
from chefbotd.components.navigation.algorithms.outline import Footprint, clearance_m
from chefbotd.components.navigation.algorithms.path import ESCAPE_M, SPACING_M, Goal, NoPath, Path
from chefbotd.components.navigation.algorithms.search import BLOCKED, prepare_costs
from chefbotd.components.navigation.algorithms.smooth import (
    first_touch,
    headings,
    resample_path,
    round_corners,
    straighten_path,
    touches,
)
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import replace
from chefbotd.core.sentence import Sentence

WIDE_M: Final = 0.18
"""With less room than this beside the outline, smoothing keeps to the middle."""

ATTEMPTS: Final = 8
"""If an outline that is no circle does not fit along a path, that place is closed and another path is searched."""


def plan(outline: Footprint, costs: Costmap, start: Pose2D, goal: Goal) -> Path | NoPath:
    """The best path by the costs; start and goal are poses in the map.

    A goal where the robot cannot be is refused, with the nearest pose that it can reach.
    """
    pose = costs.frame.pose_to_grid(start)
    if costs.frame.cell(pose.x_m, pose.y_m) is None:
        return NoPath(
            Sentence(
                "navigation.outside",
                "the robot is outside of the map, at ({x_m:.2f}, {y_m:.2f})",
                x_m=start.x_m,
                y_m=start.y_m,
            )
        )
    end = _in_grid(costs.frame, goal)
    problem = _problem(outline, costs, end)
    if problem is None:
        path = _between(outline, costs, pose, end, goal)
        wall_m = None if path is None else wall_before_goal(outline, costs, path)
        if path is not None and wall_m is None:
            return path
        why: str = Sentence(
            "navigation.no_way",
            "there is no way to ({x_m:.2f}, {y_m:.2f}) that is wide enough for the robot",
            x_m=goal.x_m,
            y_m=goal.y_m,
        )
        if wall_m is not None:
            why = _kept_from(costs, goal, wall_m)
    else:
        why = Sentence(
            "navigation.goal_is",
            "the goal ({x_m:.2f}, {y_m:.2f}) {what}",
            x_m=goal.x_m,
            y_m=goal.y_m,
            what=problem,
        )
    nearest = nearest_free(outline, costs, pose, end, goal.tolerance_m)
    if nearest is None and not _flood_free(costs, pose).any():
        return NoPath(
            Sentence(
                "navigation.robot_enclosed",
                "{why}: the robot itself is in an obstacle or a keep-out zone, at ({x_m:.2f}, {y_m:.2f}), and cannot "
                "leave it",
                why=why,
                x_m=start.x_m,
                y_m=start.y_m,
            )
        )
    if nearest is None:
        return NoPath(
            Sentence(
                "navigation.no_free_place",
                "{why}, and there is no free place near it that can be reached",
                why=why,
            )
        )
    away_m = math.hypot(nearest.x_m - end.x_m, nearest.y_m - end.y_m)
    offered = costs.frame.pose_to_map(nearest)
    if away_m <= goal.tolerance_m:
        heading_rad = None if goal.heading_rad is None else offered.heading_rad
        other = Goal(offered.x_m, offered.y_m, heading_rad, goal.tolerance_m, goal.max_speed_m_s)
        path = _between(outline, costs, pose, nearest, other, is_substitute=True)
        if path is not None:
            return path
    nearest_reached = Sentence(
        "navigation.nearest",
        "{why}; the nearest place that can be reached is ({x_m:.2f}, {y_m:.2f}), {away_m:.2f} m from it",
        why=why,
        x_m=offered.x_m,
        y_m=offered.y_m,
        away_m=away_m,
    )
    return NoPath(nearest_reached, offered)


def _kept_from(costs: Costmap, goal: Goal, wall_m: Floats) -> str:
    guards = costs.inflation.guards
    return Sentence(
        "navigation.kept_from",
        "the goal ({x_m:.2f}, {y_m:.2f}) is too near to the wall of the map at ({wall_x_m:.2f}, {wall_y_m:.2f}): the "
        "obstacle guards stop the robot {before_m:.2f} m before it",
        x_m=goal.x_m,
        y_m=goal.y_m,
        wall_x_m=float(wall_m[0]),
        wall_y_m=float(wall_m[1]),
        before_m=guards.stop_m + guards.clearance_m,
    )


def _in_grid(frame: GridFrame, goal: Goal) -> Pose2D:
    return frame.pose_to_grid(Pose2D(goal.x_m, goal.y_m, goal.heading_rad or 0.0))


def _problem(outline: Footprint, costs: Costmap, pose: Pose2D) -> str | None:
    """Why the robot cannot be at a pose of the grid's frame; None when it can."""
    cell = costs.frame.cell(pose.x_m, pose.y_m)
    if cell is None:
        return Sentence("navigation.goal_outside", "is outside of the map")
    if costs.distance_m[cell] == 0:
        return Sentence("navigation.goal_in_obstacle", "is inside an obstacle")
    if math.isinf(costs.surcharges[cell]):
        return Sentence("navigation.goal_unknown", "is in unknown space")
    needed_m, has_m = outline.inner_radius_m, costs.distance_m[cell]
    if math.isinf(costs.costs[cell]):
        return Sentence(
            "navigation.goal_too_near",
            "is {has_m:.2f} m from an obstacle, and the robot needs {needed_m:.2f} m",
            has_m=has_m,
            needed_m=needed_m,
        )
    if _touches(outline, costs, pose):
        at = _find_touch(outline, costs, pose)
        return Sentence(
            "navigation.goal_touches",
            "has a heading with which the robot would touch the obstacle at {at}",
            at=at,
        )
    return None


def _find_touch(outline: Footprint, costs: Costmap, pose: Pose2D) -> str:
    """Where in the map the obstacle is that lies deepest in the outline at a pose of the grid's frame."""
    frame, reach_m = costs.frame, outline.outer_radius_m + costs.frame.resolution_m
    rows, columns = np.nonzero(costs.distance_m == 0)
    centers = (np.stack([columns, rows], axis=1) + 0.5) * frame.resolution_m
    centers = centers[np.hypot(centers[:, 0] - pose.x_m, centers[:, 1] - pose.y_m) < reach_m]
    back = pose.inverse()
    seen = [back.compose(Pose2D(float(x_m), float(y_m))) for x_m, y_m in centers]
    hull, pad_m = outline.hull, outline.pad_m
    apart_m = [clearance_m(hull, pad_m, point.x_m, point.y_m) for point in seen]
    x_m, y_m = frame.to_map(centers[[int(np.argmin(apart_m))]])[0]
    return f"({x_m:.2f}, {y_m:.2f})"


def _touches(outline: Footprint, costs: Costmap, pose: Pose2D) -> bool:
    if outline.radius_m is not None:
        return False  # a circle fits wherever its middle is not blocked
    hull, pad_m, outer_m = outline.hull, outline.pad_m, outline.outer_radius_m
    cell_m = costs.frame.resolution_m
    return touches(pose.x_m, pose.y_m, pose.heading_rad, hull, pad_m, outer_m, costs.distance_m, cell_m)


def nearest_free(
    outline: Footprint, costs: Costmap, pose: Pose2D, end: Pose2D, tolerance_m: float = 0.0
) -> Pose2D | None:
    """The pose nearest to ``end``, with its heading, that is free and can be reached; in the grid's frame.

    Guards stop a robot that drives towards a wall. So a pose with more room is better, up to twice as much farther away
    as the other lacks, but no pose beyond ``tolerance_m`` is better than one within.
    """
    cell_m, inflation = costs.frame.resolution_m, costs.inflation
    reached, guards = _flood_free(costs, pose), inflation.guards
    roomy = reached & (costs.distance_m >= inflation.inner_m + guards.stop_m + guards.clearance_m)
    rows, columns = np.nonzero(roomy if roomy.any() else reached)
    away = np.hypot((columns + 0.5) * cell_m - end.x_m, (rows + 0.5) * cell_m - end.y_m)
    lacking_m = np.maximum(inflation.inner_m + inflation.tight_m - costs.distance_m[rows, columns], 0.0)
    for k in np.lexsort((away + 2 * lacking_m, away > tolerance_m))[:5000]:
        x_m, y_m = costs.frame.center(int(rows[k]), int(columns[k]))
        pose = Pose2D(x_m, y_m, end.heading_rad)
        if not _touches(outline, costs, pose):
            return pose
    return None


def _flood_free(costs: Costmap, pose: Pose2D) -> Flags:
    """Which free cells the robot can get to from where it stands, were it a point with its inner radius."""
    free = np.isfinite(costs.costs)
    begin = costs.frame.cell(pose.x_m, pose.y_m)
    if begin is None:
        return np.zeros_like(free)
    parts, _ = ndimage.label(np.isfinite(_with_escape(costs, begin)))
    return np.asarray((parts == parts[begin]) & free)


def _between(
    outline: Footprint, costs: Costmap, pose: Pose2D, end: Pose2D, goal: Goal, *, is_substitute: bool = False
) -> Path | None:
    for _ in range(ATTEMPTS):
        points = _points(outline, costs, pose, end)
        if points is None:
            break
        heading_rad = headings(points)
        touched = -1
        if outline.radius_m is None:
            fixed = _after_escape(points)
            hull, pad_m, cell_m = outline.hull, outline.pad_m, costs.frame.resolution_m
            touched = first_touch(points[fixed:], heading_rad[fixed:], hull, pad_m, costs.distance_m, cell_m)
        if touched < 0:
            return Path(costs.frame, points, heading_rad, goal, is_substitute)
        costs = _close_point(costs, points[_after_escape(points) + touched])
    return None


def _after_escape(points: Floats) -> int:
    """The first point that is not about where the robot stands: there it fits, since it is there."""
    away = np.hypot(points[:, 0] - points[0, 0], points[:, 1] - points[0, 1])
    beyond = np.flatnonzero(away > ESCAPE_M)
    return int(beyond[0]) if len(beyond) else len(points)


def _close_point(costs: Costmap, point: Floats) -> Costmap:
    cell = costs.frame.cell(float(point[0]), float(point[1]))
    blocked = costs.costs.copy()
    if cell is not None:
        row, column = cell
        blocked[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = BLOCKED
    return replace(costs, costs=blocked)


def _points(outline: Footprint, costs: Costmap, pose: Pose2D, end: Pose2D) -> Floats | None:
    """A smoothed path between two poses of the grid's frame, which begins and ends exactly at them."""
    frame = costs.frame
    first, last = frame.cell(pose.x_m, pose.y_m), frame.cell(end.x_m, end.y_m)
    if first is None or last is None:
        return None
    passable = _with_escape(costs, first)
    grid = costs.search_grid if passable is costs.costs else prepare_costs(passable)
    cheapest = grid.find_path(first, last)
    if cheapest is None:
        return None
    corners = straighten_path(cheapest.cells, passable, frame.resolution_m)
    if len(corners) == 1:
        corners = np.repeat(corners, 2, axis=0)
    corners[0], corners[-1] = (pose.x_m, pose.y_m), (end.x_m, end.y_m)
    points = resample_path(corners, SPACING_M)
    wide_m = outline.inner_radius_m + WIDE_M
    smoothed = round_corners(points, passable, costs.distance_m, costs.standing_m, frame.resolution_m, wide_m)
    return resample_path(smoothed, SPACING_M)


def _with_escape(costs: Costmap, begin: tuple[int, int]) -> Singles:
    """The costs; where the robot itself stands too near to an obstacle, with the cells about it open at a price."""
    if np.isfinite(costs.costs[begin]):
        return costs.costs
    opened = costs.costs.copy()
    reach = math.ceil(ESCAPE_M / costs.frame.resolution_m)
    row, column = begin
    box = (slice(max(row - reach, 0), row + reach + 1), slice(max(column - reach, 0), column + reach + 1))
    lacking = 1.0 - np.minimum(costs.distance_m[box] / costs.inflation.inner_m, 1.0)
    closed = np.isinf(opened[box]) & (costs.distance_m[box] > 0)
    opened[box] = np.where(closed, 10.0 + 20.0 * lacking, opened[box])
    opened[begin] = 10.0
    return opened
