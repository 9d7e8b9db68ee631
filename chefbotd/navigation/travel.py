"""Estimates how long a path takes: the speed that walls, curves and zones allow, and the turns at both ends."""

import math

import numpy as np

from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.navigation.costmap import Costmap
from chefbotd.navigation.planner import Path
from chefbotd.navigation.steering import FollowerParameters


def seconds(params: FollowerParameters, path: Path, grid_from_base: Pose2D, costs: Costmap | None) -> float:
    """From where the robot is, in the grid's frame, to standing at the end with the goal's heading."""
    if len(path.points_m) < 2:
        return 0.0
    lengths = np.hypot(*np.diff(path.points_m, axis=0).T)
    speed = np.full(len(lengths), params.max_speed_m_s)
    if costs is not None:
        columns, rows = np.floor(path.points_m[1:] / path.frame.resolution_m).astype(np.int64).T
        room = np.maximum(costs.distance_m[rows, columns] - costs.inflation.inner_m, 0.0)
        share = np.minimum(room / params.arcs.full_speed_room_m, 1.0)
        creep = params.arcs.creep_m_s
        speed = np.minimum(creep + (speed - creep) * share, costs.speed_limit_m_s[rows, columns])
    first = float(path.heading_rad[min(4, len(path.heading_rad) - 1)])
    turned = abs(wrap_angle(first - grid_from_base.heading_rad))
    if path.goal.heading_rad is not None:
        end = path.frame.pose_to_grid(Pose2D(path.goal.x_m, path.goal.y_m, path.goal.heading_rad))
        turned += abs(wrap_angle(end.heading_rad - float(path.heading_rad[-1])))
    started = params.max_speed_m_s / (2 * params.acceleration_m_s2) * 2
    return float((lengths / speed).sum()) + turned / params.max_turn_rad_s + math.copysign(started, 1.0)
