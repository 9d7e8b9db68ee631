"""Driving from point to point: pure functions from the robot's pose to a velocity."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TypeAlias

from chefbotd.core.geometry import Pose2D, Twist2D, wrap_angle

Point: TypeAlias = tuple[float, float]


#: Speeds and tolerances: within doors 0.9 m wide the robot has 25 cm on each side.
CRUISE_M_S, CREEP_M_S = 0.32, 0.08
DECELERATION_M_S2 = 0.35
TURN_RAD_S, TURN_GAIN_PER_S = 0.9, 1.8
"""The classic board is silent for up to a second when an echo is missing: turning fast, it overshoots meanwhile."""
TURN_IN_PLACE_RAD = 0.5
"""With more to turn it stands meanwhile."""
REACHED_M = 0.1


def seen_from(start: Pose2D, points: Sequence[Point]) -> tuple[Point, ...]:
    """Points of the plan in the map of a robot that began at ``start``."""
    poses = [start.inverse().compose(Pose2D(x_m, y_m)) for x_m, y_m in points]
    return tuple((pose.x_m, pose.y_m) for pose in poses)


def length_m(pose: Pose2D, points: Sequence[Point]) -> float:
    """The way from the robot through all points."""
    corners = [(pose.x_m, pose.y_m), *points]
    return sum(math.dist(a, b) for a, b in pairwise(corners))


def is_reached(pose: Pose2D, point: Point) -> bool:
    """Whether the robot is at the point."""
    return math.dist((pose.x_m, pose.y_m), point) <= REACHED_M


def velocity_to(pose: Pose2D, point: Point, after: Point | None) -> Twist2D:
    """The velocity towards a point; it slows down as much as the turn towards the point after it asks."""
    dx, dy = point[0] - pose.x_m, point[1] - pose.y_m
    off_rad = wrap_angle(math.atan2(dy, dx) - pose.heading_rad)
    angular = max(-TURN_RAD_S, min(TURN_RAD_S, TURN_GAIN_PER_S * off_rad))
    if abs(off_rad) > TURN_IN_PLACE_RAD:
        return Twist2D(0.0, angular)
    at_point_m_s = CRUISE_M_S * max(0.0, _straightness(pose, point, after))
    braking = math.sqrt(at_point_m_s**2 + 2 * DECELERATION_M_S2 * math.hypot(dx, dy))
    linear = max(CREEP_M_S, min(CRUISE_M_S, braking))
    return Twist2D(linear * math.cos(off_rad), angular)


def _straightness(pose: Pose2D, point: Point, after: Point | None) -> float:
    """1 where the way goes straight on at the point, 0 from a turn of 60 degrees, or at the end."""
    if after is None:
        return 0.0
    here = math.atan2(point[1] - pose.y_m, point[0] - pose.x_m)
    bearing_after = math.atan2(after[1] - point[1], after[0] - point[0])
    return 2 * math.cos(wrap_angle(bearing_after - here)) - 1
