"""Chooses the arc to drive: the one to the path, or a free one beside it that keeps distance from obstacles."""

import math
from collections.abc import Iterable, Iterator

from chefbotd.components.navigation.algorithms.arcs import HORIZON_M, KEEP_FOR_M, Arc, check_arc, check_turn
from chefbotd.components.navigation.algorithms.steering import ALIGNED_RAD, MOST_CURVATURE_PER_M, Control
from chefbotd.components.navigation.algorithms.surroundings import turn_surroundings
from chefbotd.core.record import replace

CLEAR_WORTH, SLIGHT_M = 4.0, 0.005
"""A metre less of room to standing obstacles is as bad as so many beside the arc; less than ``SLIGHT_M`` is nothing."""

NEEDED_M = 0.4
"""A clearer arc need not be free farther than this: the next step chooses again."""

BEYOND_M = 0.2
"""An arc is to be free so far beyond the point that it leads to. In a tight passage the robot is in line there: the arc
itself would go on into its wall."""

TURN_GAIN_M = 0.015
"""The robot first turns on the spot if the arc lacks so much more room than turning and driving straight."""


def free_arc(
    control: Control, curvature: float, carrot: tuple[float, float], beyond_m: float = BEYOND_M
) -> tuple[float, Arc]:
    """The curvature of the arc to the carrot or, if it is not free far enough, of the best one beside it; that arc."""
    direct = limited_arc(control, curvature)
    enough_m = min(0.6, math.hypot(*carrot) + beyond_m)
    if direct.free >= enough_m:
        return curvature, direct
    best, chosen = _worth(direct, curvature, curvature, carrot), (curvature, direct)
    for _, tried in _beside(curvature, (0.4, 0.8, 1.3, 2.0, 3.0, 4.5)):
        arc = limited_arc(control, tried)
        worth = _worth(arc, tried, curvature, carrot)
        if worth > best:
            best, chosen = worth, (tried, arc)
    return chosen


def clear_arc(
    control: Control, curvature: float, arc: Arc, horizon_m: float | None = None
) -> tuple[float, Arc]:
    """The same arc, or one a little beside it that keeps farther from standing obstacles and is as free."""
    best, chosen = CLEAR_WORTH * arc.lacking_m, (curvature, arc)
    if arc.lacking_m < SLIGHT_M:
        return chosen
    for step, tried in _beside(curvature, (0.15, 0.4, 0.8, 1.2, 1.8)):
        off_m = step * KEEP_FOR_M**2 / 2
        other = limited_arc(control, tried, horizon_m)
        worth = CLEAR_WORTH * other.lacking_m + off_m
        if worth < best and other.free >= min(arc.free, NEEDED_M) - 1e-6:
            best, chosen = worth, (tried, other)
    return chosen


def _beside(curvature: float, steps: Iterable[float]) -> Iterator[tuple[float, float]]:
    """Each step, and the curvatures to its left and right that the robot can drive, the nearest first."""
    for step in steps:
        for tried in (curvature - step, curvature + step):
            if abs(tried) <= MOST_CURVATURE_PER_M:
                yield step, tried


def is_clearer_turned(control: Control, bearing_rad: float, away_m: float, arc: Arc) -> bool:
    """Whether turning on the spot before driving leaves more room than the arc."""
    if arc.lacking_m < TURN_GAIN_M or abs(bearing_rad) <= ALIGNED_RAD:
        return False
    free_rad = check_turn(control.outline, control.surroundings, bearing_rad).free
    straight = limited_arc(
        replace(control, surroundings=turn_surroundings(control.surroundings, bearing_rad)), 0.0, away_m
    )
    is_clearer = straight.lacking_m + TURN_GAIN_M < arc.lacking_m
    return is_clearer and straight.free >= away_m - 1e-6 and free_rad >= abs(bearing_rad) - 1e-6


def limited_arc(control: Control, curvature: float, horizon_m: float | None = None) -> Arc:
    """An arc driven as fast as the robot may: forwards or, with a negative horizon, backwards."""
    horizon_m, limits = HORIZON_M if horizon_m is None else horizon_m, control.limits
    most = limits.max_speed_m_s if horizon_m > 0 else limits.max_reverse_m_s
    speed_m_s = min(most, limits.curve_turn_rad_s / max(abs(curvature), 1e-6))
    return check_arc(
        control.outline, control.surroundings, curvature, horizon_m, speed_m_s, limits.deceleration_m_s2
    )


def _worth(arc: Arc, curvature: float, direct: float, carrot: tuple[float, float]) -> float:
    """Free length counts most, then an end near the carrot, room beside, and a curvature near the direct one."""
    half = curvature * math.hypot(*carrot) / 2
    chord = math.hypot(*carrot) * (math.sin(half) / half if abs(half) > 1e-6 else 1.0)
    off_m = math.hypot(chord * math.cos(half) - carrot[0], chord * math.sin(half) - carrot[1])
    beside_m = 0.3 * min(arc.room_m, 0.2) - CLEAR_WORTH * arc.lacking_m
    return min(arc.free, 0.6) - 0.8 * off_m + beside_m - 0.02 * abs(curvature - direct)
