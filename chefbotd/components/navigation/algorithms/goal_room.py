"""Whether the obstacle guards let the robot come as near to a wall of the map as its goal is."""

import math

import numpy as np

from chefbotd.components.navigation.algorithms.costmap import Costmap
from chefbotd.components.navigation.algorithms.grid import Floats, place_points
from chefbotd.components.navigation.algorithms.outline import Footprint, clearances_m
from chefbotd.components.navigation.algorithms.path import Path
from chefbotd.core.geometry import Pose2D

APPROACH_M = 0.15
"""The robot comes to its goal in the direction of so much of the path's end."""

ARRIVES_M = 0.02
"""The robot has arrived so far before its goal."""

ROUNDING_CELLS = 0.25
"""A wall may be so much farther than the middle of its cell."""

AHEAD_SHARE = 0.5
"""What comes nearer by a smaller share of the robot's way is beside it, and not ahead."""


def wall_before_goal(outline: Footprint, costs: Costmap, path: Path) -> Floats | None:
    """The place (x, y in the map) of the wall for which the guards would stop the robot before the path's end.

    What is ahead where it arrives stops it; a wall beside it, as in a corridor, does not. None: there is no such wall.
    """
    guards, end = costs.inflation.guards, path.points_m[-1]
    ahead_m = guards.stop_m - ARRIVES_M
    away_m = np.hypot(path.points_m[:, 0] - end[0], path.points_m[:, 1] - end[1])
    before = np.flatnonzero(away_m >= APPROACH_M)
    if ahead_m <= 0 or not len(before):
        return None
    dx, dy = end - path.points_m[int(before[-1])]
    pose = Pose2D(float(end[0]), float(end[1]), math.atan2(dy, dx))
    return _nearest_ahead(outline, costs, pose, ahead_m, guards.clearance_m)


def _nearest_ahead(
    outline: Footprint, costs: Costmap, end: Pose2D, ahead_m: float, within_m: float
) -> Floats | None:
    """The place in the map of the obstacle that is so near to the outline ``ahead_m`` beyond a pose of the grid's frame.

    On the way there it comes nearer by half of the way or more: what does not is beside the robot. A wall may be
    anywhere in its cell.
    """
    pose = end.compose(Pose2D(ahead_m, 0.0))
    frame = costs.frame
    reach_m = outline.outer_radius_m + within_m + frame.resolution_m
    rows, columns = np.nonzero(costs.walls)
    centers = (np.stack([columns, rows], axis=1) + 0.5) * frame.resolution_m
    centers = centers[np.hypot(centers[:, 0] - pose.x_m, centers[:, 1] - pose.y_m) < reach_m]
    if not len(centers):
        return None
    apart_m = _clearances_m(outline, pose, centers)
    is_ahead = _clearances_m(outline, end, centers) - apart_m >= AHEAD_SHARE * ahead_m
    centers, apart_m = centers[is_ahead], apart_m[is_ahead]
    if not len(centers):
        return None
    k = int(np.argmin(apart_m))
    if apart_m[k] >= within_m - ROUNDING_CELLS * frame.resolution_m:
        return None
    place: Floats = frame.to_map(centers[[k]])[0]
    return place


def _clearances_m(outline: Footprint, pose: Pose2D, points_m: Floats) -> Floats:
    """How far points of the grid's frame are outside of the outline of a robot at a pose."""
    return clearances_m(outline.hull, outline.pad_m, place_points(pose.inverse(), points_m))
