"""Slows the robot beside people who walk: with less than 0.1 m between them it creeps or stands, unless it makes way."""

import math
from typing import Final

import numpy as np

from chefbotd.components.navigation.algorithms.arcs import CREEP_M_S, along_arc
from chefbotd.components.navigation.algorithms.evade import GRAZED_M, SPEED_M_S
from chefbotd.components.navigation.algorithms.grid import Floats
from chefbotd.components.navigation.algorithms.outline import Footprint, clearance_m
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.geometry import Twist2D

CLOSE_M: Final = 0.1
"""With less than this between the outline and a person who walks the robot is no faster than ``CREEP_M_S``,"""

STANDS_M: Final = 0.03
"""and with less than this it stands."""

AHEAD_S, STEP_S = 0.8, 0.1
"""It looks so far ahead, and slows down in time."""

DECELERATION_M_S2: Final = 0.4

WIDENS_M, CLEARS_M = 0.006, 0.0025
"""Where standing may end in a touch, a motion that leaves so much more room, and so much at all, makes way. Where
standing is safe it is no reason to be fast beside somebody."""

GRAZING_M: Final = 0.05
"""With less than this, somebody who seems to pass may touch: with 1 and 3 cm two of 24 in a corridor touched."""

DOUBT_M: Final = 0.03
"""A predicted gap may be wrong by so much. Somebody who would graze the robot is evaded on, if that leaves so much more
room than standing (once it goes, half of that), creeping: he may not touch at all."""

EVADES_M_S: Final = 0.25
"""Where he surely would, the robot makes way so fast: slower it would be touched while it moves."""


def slowed_beside_people(
    outline: Footprint, surroundings: Surroundings, twist: Twist2D | None
) -> Twist2D | None:
    """The twist, or a slower one along the same arc where somebody who walks is, or will be, close to the robot."""
    if twist is None or abs(twist.linear_m_s) < 1e-3:
        return twist
    walks = surroundings.velocity_m_s.any(axis=1)
    if surroundings.is_walker is not None:
        walks &= surroundings.is_walker
    if not walks.any():
        return twist
    motion = np.array([twist.linear_m_s, twist.angular_rad_s])
    points, velocity = surroundings.points_m[walks], surroundings.velocity_m_s[walks]
    close_s, driving_m, standing_m, now_m = _gaps(outline.hull, outline.pad_m, points, velocity, motion)
    makes_way = standing_m < GRAZING_M and driving_m > max(standing_m + WIDENS_M, CLEARS_M)
    if close_s == math.inf or makes_way:
        return twist
    _, evading_m, _, _ = _gaps(
        outline.hull, outline.pad_m, points, velocity, motion * SPEED_M_S / abs(motion[0])
    )
    gain_m = DOUBT_M / 2 if surroundings.speed_m_s * motion[0] > 0 else DOUBT_M
    evades = standing_m >= -GRAZED_M and evading_m > max(standing_m + gain_m, -DOUBT_M)
    share = 1.0 if evades else min(max((now_m - STANDS_M) / (CLOSE_M - STANDS_M), 0.0), 1.0)
    least_m_s = EVADES_M_S if evades and standing_m < -DOUBT_M else CREEP_M_S * share
    allowed_m_s = least_m_s + DECELERATION_M_S2 * close_s
    share = min(allowed_m_s / abs(twist.linear_m_s), 1.0)
    return Twist2D(twist.linear_m_s * share, twist.angular_rad_s * share)


@kernel
def _gaps(
    hull: Floats, pad_m: float, points: Floats, velocity: Floats, motion: Floats
) -> tuple[float, float, float, float]:
    """When the robot, driving so, is first close to a point; the least gap then, of one that stands, and now."""
    close_s, driving_m, standing_m, now_m = math.inf, math.inf, math.inf, math.inf
    linear, curvature = motion[0], motion[1] / motion[0]
    for k in range(int(AHEAD_S / STEP_S) + 1):
        time_s = k * STEP_S
        x, y, heading = along_arc(linear * time_s, curvature)
        cos, sin = math.cos(heading), math.sin(heading)
        for i in range(points.shape[0]):
            px, py = points[i, 0] + velocity[i, 0] * time_s, points[i, 1] + velocity[i, 1] * time_s
            dx, dy = px - x, py - y
            gap_m = clearance_m(hull, pad_m, cos * dx + sin * dy, cos * dy - sin * dx)
            driving_m, standing_m = min(driving_m, gap_m), min(standing_m, clearance_m(hull, pad_m, px, py))
            if k == 0:
                now_m = min(now_m, gap_m)
            if gap_m < CLOSE_M and time_s < close_s:
                close_s = time_s
    return close_s, driving_m, standing_m, now_m
