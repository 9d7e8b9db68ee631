"""Whether the obstacle guards let the robot come as near to a wall of the map as its goal is."""

import math

import numpy as np

from chefbotd.components.navigation.algorithms.costmap import ROUNDING_CELLS, Costmap
from chefbotd.components.navigation.algorithms.grid import Floats
from chefbotd.components.navigation.algorithms.outline import Footprint, clearance_m
from chefbotd.components.navigation.algorithms.path import Path
from chefbotd.core.geometry import Pose2D

APPROACH_M = 0.15
"""The robot comes to its goal in the direction of so much of the path's end."""

ARRIVES_M = 0.02
"""The robot has arrived so far before its goal."""


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
    heading_rad = math.atan2(dy, dx)
    stopped = Pose2D(float(end[0]), float(end[1]), heading_rad).compose(Pose2D(ahead_m, 0.0))
    return _nearest_within(outline, costs, stopped, guards.clearance_m)


def _nearest_within(outline: Footprint, costs: Costmap, pose: Pose2D, within_m: float) -> Floats | None:
    """The place in the map of its nearest obstacle, if that is so near to the outline at a pose of the grid's frame.

    A wall may be anywhere in its cell.
    """
    frame = costs.frame
    reach_m = outline.outer_radius_m + within_m + frame.resolution_m
    rows, columns = np.nonzero(costs.walls)
    centers = (np.stack([columns, rows], axis=1) + 0.5) * frame.resolution_m
    centers = centers[np.hypot(centers[:, 0] - pose.x_m, centers[:, 1] - pose.y_m) < reach_m]
    if not len(centers):
        return None
    back = pose.inverse()
    seen = [back.compose(Pose2D(float(x_m), float(y_m))) for x_m, y_m in centers]
    apart_m = [clearance_m(outline.hull, outline.pad_m, point.x_m, point.y_m) for point in seen]
    k = int(np.argmin(apart_m))
    if apart_m[k] >= within_m - ROUNDING_CELLS * frame.resolution_m:
        return None
    place: Floats = frame.to_map(centers[[k]])[0]
    return place
