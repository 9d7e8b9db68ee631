"""One step along a trip: the surroundings, the allowed speed, and the follower's twist."""

import math
from typing import Final

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import replace
from chefbotd.navigation.awareness import Awareness
from chefbotd.navigation.follower import follow
from chefbotd.navigation.input_watch import POSE_SILENT_S
from chefbotd.navigation.parameters import NavigationParameters
from chefbotd.navigation.reports import PoseStatus, StepInput
from chefbotd.navigation.steering import Followed, Track, predicted
from chefbotd.navigation.surroundings import Surroundings
from chefbotd.navigation.trips import Trip

POSE_LATE_S: Final = 0.2
"""With odometry that is older the robot drives more slowly."""

UNCERTAIN_SPEED_M_S: Final = 0.12
"""No faster while it is not sure where it is."""

TRIED_S = 0.05
"""A first step that is only tried takes so long."""


def surroundings(params: NavigationParameters, known: Awareness, now: StepInput) -> Surroundings:
    """What is about the robot, where it will be when the twist takes effect."""
    here = predicted(params.follower, known.frame.pose_to_grid(now.pose), now.last)
    return known.surroundings(here, now.now_s, now.last.linear_m_s)


def follow_trip(
    params: NavigationParameters, known: Awareness, trip: Trip, now: StepInput, near: Surroundings
) -> Followed:
    """The next twist along the trip."""
    goal, heading_rad = trip.path.goal, None
    if goal.heading_rad is not None:
        end = Pose2D(goal.x_m, goal.y_m, goal.heading_rad)
        heading_rad = trip.path.frame.pose_to_grid(end).heading_rad
    limit_m_s = speed_limit_m_s(params, known, now, near.grid_from_base)
    track = Track(trip.path.points_m, heading_rad, limit_m_s)
    return follow(params.follower, params.outline, trip.follow, track, near, now.last, now.dt_s)


def can_begin(
    params: NavigationParameters, known: Awareness, trip: Trip, now: StepInput, near: Surroundings
) -> bool:
    """Whether nothing is in the way of the trip's first step."""
    tried = replace(now, status=PoseStatus.LOCALIZED, dt_s=TRIED_S)
    return not follow_trip(params, known, trip, tried, near).is_blocked


def speed_limit_m_s(params: NavigationParameters, known: Awareness, now: StepInput, here: Pose2D) -> float:
    """What zones, an uncertain pose, late scans and late odometry allow at a pose of the grid's frame."""
    cell = known.frame.cell(here.x_m, here.y_m)
    limit_m_s = math.inf if cell is None else float(known.ground.speed_limit_m_s[cell])
    if now.status is PoseStatus.UNCERTAIN:
        limit_m_s = min(limit_m_s, UNCERTAIN_SPEED_M_S)
    most_m_s, age_s = params.follower.max_speed_m_s, now.now_s - known.scan_stamp_s
    by_scan = _late_share(age_s, params.scan_late_s, params.scan_silent_s)
    by_pose = _late_share(now.pose_age_s, POSE_LATE_S, POSE_SILENT_S)
    return min(limit_m_s, most_m_s * min(by_scan, by_pose))


def _late_share(age_s: float, late_s: float, silent_s: float) -> float:
    """By what is late it drives more slowly, down to standing when that counts as missing."""
    return math.inf if age_s <= late_s else max((silent_s - age_s) / (silent_s - late_s), 0.0)
