"""Brakes for people who come near: within 0.1 m the robot creeps or stands unless the gap opens, and stands if touched.

Each step is taken only if the robot can brake after it in time. Where it cannot, it drives on only if that keeps
everybody away, or brakes: a little less speed where that is enough, or standing.
"""

import math
from typing import Final

import numpy as np

from chefbotd.components.navigation.algorithms.arcs import CREEP_M_S, along_arc
from chefbotd.components.navigation.algorithms.beside_people import CLOSE_M
from chefbotd.components.navigation.algorithms.evade import AGILE, BRAKING_M_S2, SPEED_M_S, Agility
from chefbotd.components.navigation.algorithms.grid import Floats
from chefbotd.components.navigation.algorithms.outline import Footprint, clearance_m
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.geometry import STANDING, Twist2D

AHEAD_S, STEP_S = 1.0, 0.04
"""It looks so far ahead, or as long as it needs to stand if that is longer."""

HELD_S: Final = 0.08
"""It can brake only so long after it has chosen a motion: two steps."""

DECELERATION_M_S2: Final = 0.75
"""It is expected to brake so fast, if its limits allow it: three quarters of ChefBot's, whose motors are assumed."""

STANDS_M: Final = 0.05
"""Nearer than this it stands: a predicted gap may be wrong by so much."""

NEAR_M: Final = CLOSE_M + 0.03
"""Nearer than this it creeps, for the same reason,"""

CREEPS_M_S: Final = CREEP_M_S + 0.01
"""no faster than this."""

GRAZED_M: Final = 0.03
"""Who would come nearer than this to a robot that stands may touch it. It makes way, fast where that leaves"""

CLEARS_M: Final = 0.11
"""so much, and creeping where that leaves"""

GAIN_M: Final = 0.01
"""so much more than standing, and"""

SOON_M: Final = 0.015
"""so much until it could stand."""

SLOWER_M_S = (0.01, 0.02, 0.03)
"""By so much its speed is reduced in one step where that is enough. It stands below ``LEAST_M_S``."""

LEAST_M_S: Final = 0.03

MOVES_M_S: Final = 0.02
"""A robot that is slower stands."""

SAME_M_S: Final = 0.005
"""A wish that is slower by more brakes for something else: it is no way to keep away from somebody."""


def brake_for_people(
    outline: Footprint,
    near: Surroundings,
    last: Twist2D,
    twist: Twist2D | None,
    wish: Twist2D | None,
    agility: Agility = AGILE,
) -> Twist2D | None:
    """``twist``, or the faster ``wish`` where only that keeps people away, or a slower twist, or standing.

    ``last`` is driven now, and ``agility`` is how fast the robot's limits let that change. Nobody who stands, and no
    chair that only seems to move, makes a difference.
    """
    walks = near.velocity_m_s.any(axis=1)
    if near.is_walker is not None:
        walks &= near.is_walker
    chosen = STANDING if twist is None else twist
    arc = chosen if abs(chosen.linear_m_s) > 1e-3 else last
    if not walks.any() or abs(arc.linear_m_s) < 1e-3:
        return twist
    points, velocity, going_m_s = near.points_m[walks], near.velocity_m_s[walks], last.linear_m_s
    curvature = arc.angular_rad_s / arc.linear_m_s
    gains = min(BRAKING_M_S2, agility.acceleration_m_s2)
    brakes = min(DECELERATION_M_S2, agility.deceleration_m_s2)
    fastest_m_s = max(abs(going_m_s), abs(chosen.linear_m_s), SPEED_M_S)
    ahead_s = max(AHEAD_S, HELD_S + fastest_m_s / brakes)

    def meet(speed_m_s: float, curvature: float, held_s: float) -> tuple[bool, float, float]:
        motion = np.array([going_m_s, speed_m_s, curvature, held_s, gains, brakes, ahead_s])
        return _meet(outline.hull, outline.pad_m, points, velocity, motion)

    is_too_fast, _, _ = meet(chosen.linear_m_s, curvature, HELD_S)
    if not is_too_fast:
        return twist
    wish_m = -math.inf
    if wish is not None and abs(wish.linear_m_s) > max(abs(going_m_s) - SAME_M_S, 1e-3):
        speed_m_s = math.copysign(SPEED_M_S, wish.linear_m_s)
        _, _, wish_m = meet(speed_m_s, wish.angular_rad_s / wish.linear_m_s, math.inf)
    _, braking_m, standing_m = meet(0.0, curvature, 0.0)
    is_too_late, is_grazed = braking_m <= 0.0, standing_m < GRAZED_M
    is_clear = wish_m >= (CLEARS_M if is_grazed else NEAR_M)
    if is_clear or (is_too_late and wish_m > braking_m):
        return wish
    if is_grazed and wish is not None and abs(wish.linear_m_s) > 1e-3:
        curvature_of_wish = wish.angular_rad_s / wish.linear_m_s
        speed_m_s = math.copysign(min(CREEPS_M_S, abs(wish.linear_m_s)), wish.linear_m_s)
        _, _, creeping_m = meet(math.copysign(CREEPS_M_S, speed_m_s), curvature_of_wish, math.inf)
        _, soon_m, _ = meet(speed_m_s, curvature_of_wish, HELD_S)
        if creeping_m >= standing_m + GAIN_M and soon_m >= SOON_M:
            return Twist2D(speed_m_s, speed_m_s * curvature_of_wish)
    for less_m_s in SLOWER_M_S:
        speed_m_s = abs(going_m_s) - less_m_s
        if LEAST_M_S < speed_m_s < abs(chosen.linear_m_s):
            slower = math.copysign(speed_m_s, arc.linear_m_s)
            if not meet(slower, curvature, HELD_S)[0]:
                return Twist2D(slower, slower * curvature)
    return STANDING


@kernel
def _meet(
    hull: Floats, pad_m: float, points: Floats, velocity: Floats, motion: Floats
) -> tuple[bool, float, float]:
    """Whether the robot is too fast near somebody; the least gap while it moves, and at all.

    It changes its speed to another along an arc, and brakes after a time.
    """
    going, target, curvature, held_s, gains, brakes, ahead_s = motion
    is_too_fast, moving_m, least_m, before_m, s = False, math.inf, math.inf, math.inf, 0.0
    for k in range(int(ahead_s / STEP_S) + 1):
        if k > 0:
            before = going
            commanded = target if k * STEP_S <= held_s + 1e-9 else 0.0
            change = gains if abs(commanded) > abs(going) else brakes
            going += min(max(commanded - going, -change * STEP_S), change * STEP_S)
            s += (before + going) / 2 * STEP_S
        x, y, heading = along_arc(s, curvature)
        cos, sin, gap_m = math.cos(heading), math.sin(heading), math.inf
        for i in range(points.shape[0]):
            dx = points[i, 0] + velocity[i, 0] * k * STEP_S - x
            dy = points[i, 1] + velocity[i, 1] * k * STEP_S - y
            gap_m = min(gap_m, clearance_m(hull, pad_m, cos * dx + sin * dy, cos * dy - sin * dx))
        opens, before_m, least_m = gap_m > before_m, gap_m, min(least_m, gap_m)
        if abs(going) > MOVES_M_S:
            moving_m = min(moving_m, gap_m)
            is_fast = gap_m < STANDS_M or (gap_m < NEAR_M and abs(going) > CREEPS_M_S)
            is_too_fast = is_too_fast or (is_fast and not opens and k > 0)
    return is_too_fast, moving_m, least_m
