"""Chooses the arc to drive: the one to the path, or a free one beside it that keeps distance from obstacles."""

import math
from collections.abc import Iterable, Iterator

from chefbotd.navigation.arcs import HORIZON_M, KEEP_FOR_M, Way, turn, way
from chefbotd.navigation.outline import Footprint
from chefbotd.navigation.steering import ALIGNED_RAD, MOST_CURVATURE_PER_M, FollowerLimits
from chefbotd.navigation.surroundings import Surroundings, turned

CLEAR_WORTH, SLIGHT_M = 4.0, 0.005
"""A metre less of room to what stands is as bad as so many beside the wanted arc; less than ``SLIGHT_M`` is nothing."""

NEEDED_M = 0.4
"""An arc that leaves more room need not be free farther than this: the next step takes another one."""

TURN_GAIN_M = 0.015
"""Where an arc lacks so much more room than a turn on the spot and driving straight on, the robot turns."""


def free_arc(
    params: FollowerLimits,
    outline: Footprint,
    near: Surroundings,
    curvature: float,
    carrot: tuple[float, float],
) -> tuple[float, Way]:
    """The arc to the carrot, or, where that is not free far enough, the best of those about it."""
    first = arc(params, outline, near, curvature)
    enough_m = min(0.6, math.hypot(*carrot) + 0.2)
    if first.free >= enough_m:
        return curvature, first
    best, chosen = _worth(first, curvature, curvature, carrot), (curvature, first)
    for _, tried in _beside(params, curvature, (0.4, 0.8, 1.3, 2.0, 3.0, 4.5)):
        found = arc(params, outline, near, tried)
        worth = _worth(found, tried, curvature, carrot)
        if worth > best:
            best, chosen = worth, (tried, found)
    return chosen


def clear_arc(
    params: FollowerLimits,
    outline: Footprint,
    near: Surroundings,
    curvature: float,
    found: Way,
    horizon_m: float | None = None,
) -> tuple[float, Way]:
    """The same arc, or one a little beside it that leaves more room to what stands, and is as free."""
    best, chosen = CLEAR_WORTH * found.lacking_m, (curvature, found)
    if found.lacking_m < SLIGHT_M:
        return chosen
    for step, tried in _beside(params, curvature, (0.15, 0.4, 0.8, 1.2, 1.8)):
        off_m = step * KEEP_FOR_M**2 / 2
        other = arc(params, outline, near, tried, horizon_m)
        worth = CLEAR_WORTH * other.lacking_m + off_m
        if worth < best and other.free >= min(found.free, NEEDED_M) - 1e-6:
            best, chosen = worth, (tried, other)
    return chosen


def _beside(
    params: FollowerLimits, curvature: float, steps: Iterable[float]
) -> Iterator[tuple[float, float]]:
    """Each step, and the curvatures to its left and right that the robot can drive, the nearest first."""
    for step in steps:
        for tried in (curvature - step, curvature + step):
            if abs(tried) <= MOST_CURVATURE_PER_M:
                yield step, tried


def is_clearer_turned(
    params: FollowerLimits,
    outline: Footprint,
    near: Surroundings,
    bearing_rad: float,
    away_m: float,
    found: Way,
) -> bool:
    """Whether turning on the spot before driving leaves more room than the arc that was found."""
    if found.lacking_m < TURN_GAIN_M or abs(bearing_rad) <= ALIGNED_RAD:
        return False
    free_rad = turn(outline, near, bearing_rad).free
    straight = arc(params, outline, turned(near, bearing_rad), 0.0, away_m)
    is_clearer = straight.lacking_m + TURN_GAIN_M < found.lacking_m
    return is_clearer and straight.free >= away_m - 1e-6 and free_rad >= abs(bearing_rad) - 1e-6


def arc(
    params: FollowerLimits,
    outline: Footprint,
    near: Surroundings,
    curvature: float,
    horizon_m: float | None = None,
) -> Way:
    """An arc forwards, or, backwards, one with a negative horizon."""
    horizon_m = HORIZON_M if horizon_m is None else horizon_m
    most = params.max_speed_m_s if horizon_m > 0 else params.max_reverse_m_s
    limit = min(most, params.curve_turn_rad_s / max(abs(curvature), 1e-6))
    return way(outline, near, curvature, horizon_m, limit, params.deceleration_m_s2)


def _worth(found: Way, curvature: float, wanted: float, carrot: tuple[float, float]) -> float:
    """Free way counts most, then ending near the carrot, room beside, and the curvature that was wanted."""
    half = curvature * math.hypot(*carrot) / 2
    chord = math.hypot(*carrot) * (math.sin(half) / half if abs(half) > 1e-6 else 1.0)
    off_m = math.hypot(chord * math.cos(half) - carrot[0], chord * math.sin(half) - carrot[1])
    beside_m = 0.3 * min(found.room_m, 0.2) - CLEAR_WORTH * found.lacking_m
    return min(found.free, 0.6) - 0.8 * off_m + beside_m - 0.02 * abs(curvature - wanted)
