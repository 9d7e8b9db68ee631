"""The recent forward path of the robot, along which it can back out."""

import math

import numpy as np

from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.navigation.follower import backwards
from chefbotd.navigation.parameters import NavigationParameters
from chefbotd.navigation.recovery import BACK_OUT_M
from chefbotd.navigation.reports import StepInput
from chefbotd.navigation.surroundings import Surroundings

Trail = tuple[tuple[float, float], ...]
"""Points (x, y) of the grid's frame, the newest last."""

SPACING_M = 0.05
MOST_POINTS = 41
"""With their spacing: 2 m."""

LEAST_POINTS = 4
"""With fewer the robot does not know which way it came."""


def extended(trail: Trail, here: Pose2D, twist: Twist2D) -> Trail:
    """The trail of a robot that is here (in the grid's frame) and drives so."""
    if twist.linear_m_s <= 0:
        return trail
    if trail and math.hypot(here.x_m - trail[-1][0], here.y_m - trail[-1][1]) <= SPACING_M:
        return trail
    return (*trail[-(MOST_POINTS - 1) :], (here.x_m, here.y_m))


def back_out(
    params: NavigationParameters, trail: Trail, began: Pose2D, now: StepInput, near: Surroundings
) -> Twist2D | None:
    """A twist backwards; None when it is far enough, or when there is no room or no way that it came.

    ``began`` is where the robot was in the map when it began to back out.
    """
    away_m = math.hypot(now.pose.x_m - began.x_m, now.pose.y_m - began.y_m)
    if away_m >= BACK_OUT_M or len(trail) < LEAST_POINTS:
        return None
    back = np.array(trail[::-1])
    done = backwards(params.follower, params.outline, back, near, now.last, now.dt_s)
    return None if done.is_blocked else done.twist
