"""Plans how a standing robot lets a person pass who walks towards it.

Staying where it is and some short arcs, forwards and backwards, are compared by how near he would come if he walked on
as now, or as before he stopped for the robot. Who walks faster than the robot is not fled from: then only a place
beside his way is better than standing.
"""

import math
from collections.abc import Iterator
from itertools import product
from typing import Final

import numpy as np

from chefbotd.core.compiled import kernel
from chefbotd.core.geometry import Twist2D
from chefbotd.core.record import Record
from chefbotd.navigation.arcs import KEEP_M, along_arc, way
from chefbotd.navigation.distance import Flags
from chefbotd.navigation.grid_frame import Floats
from chefbotd.navigation.outline import Footprint, clearance_m
from chefbotd.navigation.surroundings import Surroundings, standing_only

CURVATURES = (0.0, -1.5, 1.5, -4.0, 4.0)
LENGTHS_M = (0.2, 0.35, 0.5, 0.65)
STEP_S = 0.1

HERE_M, NOISE_M = 0.001, 0.01
"""So short an arc shows the room that there is now; where that is less than it likes, only noise may take from it."""


GRAZED_M = 0.1
"""A touch no deeper than this is made less deep where it cannot be avoided. Who walks right over the robot is not
fled from."""


ROOM_M: Final = 0.12
"""Who is about to come nearer than this is evaded;"""

ENOUGH_M: Final = 0.20
"""more room than this is worth nothing."""

GAIN_M: Final = 0.03
"""It moves only if that leaves so much more room than standing."""

PRICE: Final = 0.04
"""Each metre of moving has to be worth so many of room."""

TOUCH_M: Final = 0.03
"""Who would come nearer than this is evaded along a way that is nearer to what stands than the robot likes, too."""

WALL_M: Final = 0.06
"""Such a way keeps so far from what stands."""

FORESIGHT_S: Final = 2.5
"""Somebody is expected to walk on as now for so long."""

PASSED_S: Final = 4.0
"""Nobody may come to the place that the robot goes to within this time."""

SPEED_M_S: Final = 0.25
BRAKING_M_S2: Final = 0.5
"""So fast the robot is taken to begin and end its motions."""

MOST_M: Final = 0.8
"""No farther than this from where it stood, before somebody who is faster: he would catch up with it anyhow."""

MOST_IF_SLOWER_M: Final = 3.0


def evasion(
    outline: Footprint,
    near: Surroundings,
    last: Twist2D,
    away_m: float,
    *,
    is_stuck: bool,
    only_touch: bool = False,
) -> Twist2D | None:
    """What to do now, ``away_m`` from where it stood.

    With ``only_touch`` nobody is evaded who would not touch the robot. Who stopped for it is made way for only if the
    robot itself cannot go on (``is_stuck``).
    None: stay, since nobody comes too near, or since no place that can be reached is better.
    """
    coming = _coming(near, is_stuck=is_stuck)
    if coming is None or away_m > _most_m(coming):
        return None
    standing = standing_only(near)
    search = _Search(outline, last, coming, standing)
    stay_m = search.least_m(0.0, 0.0, FORESIGHT_S)
    if stay_m >= (TOUCH_M if only_touch else ROOM_M):
        return None
    here_m = way(outline, standing, 0.0, HERE_M, SPEED_M_S, 1.0).room_m
    clear = search.best(stay_m, min(KEEP_M, here_m - NOISE_M))
    return clear if clear is not None or stay_m >= TOUCH_M else search.best(stay_m, WALL_M)


class _Coming(Record, frozen=True):
    """Points of those who walk, in the robot's frame, how they walk, and who waits until the robot stands."""

    points_m: Floats
    velocity_m_s: Floats
    waits: Flags


class _Search(Record, frozen=True):
    """What the arcs are judged by: who comes, and what stands about the robot."""

    outline: Footprint
    last: Twist2D
    coming: _Coming
    standing: Surroundings

    def least_m(self, curvature: float, length_m: float, within_s: float) -> float:
        """How near anybody comes while the robot goes along an arc, and stands then."""
        going_m_s = self.last.linear_m_s
        numbers = np.array(
            [self.outline.pad_m, curvature, length_m, SPEED_M_S, within_s, going_m_s, BRAKING_M_S2]
        )
        coming = self.coming
        return float(_least_m(self.outline.hull, coming.points_m, coming.velocity_m_s, coming.waits, numbers))

    def best(self, stay_m: float, wall_m: float) -> Twist2D | None:
        """The arc that is worth most, ``wall_m`` from what stands; None where staying (``stay_m``) is as good."""
        going_m_s = self.last.linear_m_s
        most, chosen = max(stay_m, -GRAZED_M) + GAIN_M, None
        for curvature, length_m in _arcs(self.outline, self.standing, wall_m):
            bonus = GAIN_M if length_m * going_m_s > 0 and abs(going_m_s) > 0.02 else 0.0
            room_m = min(self.least_m(curvature, length_m, PASSED_S), ENOUGH_M)
            worth = room_m + bonus - PRICE * abs(length_m)
            if worth > most:
                speed_m_s = math.copysign(SPEED_M_S, length_m)
                most, chosen = worth, Twist2D(speed_m_s, speed_m_s * curvature)
        return chosen


def _coming(near: Surroundings, *, is_stuck: bool) -> _Coming | None:
    """Those to be made way for; None when there is nobody."""
    intent = near.velocity_m_s if near.intent_m_s is None else near.intent_m_s
    walks: Flags = np.asarray(near.velocity_m_s.any(axis=1))
    moving: Flags = np.asarray(intent.any(axis=1)) if is_stuck else walks
    if not moving.any():
        return None
    return _Coming(near.points_m[moving], intent[moving], np.logical_not(walks[moving]))


def _most_m(coming: _Coming) -> float:
    """So far it goes away at most."""
    fastest_m_s = math.sqrt(float((coming.velocity_m_s**2).sum(axis=1).max()))
    return MOST_M if fastest_m_s > SPEED_M_S else MOST_IF_SLOWER_M


def _arcs(
    outline: Footprint,
    standing: Surroundings,
    wall_m: float,
) -> Iterator[tuple[float, float]]:
    """Curvature and length (negative: backwards) of each arc that is free, and stays so far from what stands."""
    for direction, curvature in product((-1.0, 1.0), CURVATURES):
        for length_m in LENGTHS_M:
            arc = way(outline, standing, curvature, direction * length_m, SPEED_M_S, 1.0)
            if arc.free < length_m - 1e-6 or arc.room_m < wall_m:
                break
            yield curvature, direction * length_m


def is_in_the_way(outline: Footprint, near: Surroundings, for_s: float) -> bool:
    """Whether somebody who walks would come too near to a robot that stood here for so long."""
    walks = near.velocity_m_s.any(axis=1)
    points, velocity = near.points_m[walks], near.velocity_m_s[walks]
    numbers = np.array([outline.pad_m, 0.0, 0.0, SPEED_M_S, for_s, 0.0, BRAKING_M_S2])
    least_m = _least_m(outline.hull, points, velocity, np.zeros(len(points), np.bool_), numbers)
    return float(least_m) < ROOM_M


@kernel
def _least_m(hull: Floats, points: Floats, velocity: Floats, waits: Flags, numbers: Floats) -> float:
    """How near the points come while the robot goes along an arc (backwards with a negative length), and stands then.

    It goes as it does at first, and changes that as fast as it can. Who waits goes on when the robot stands.
    """
    pad_m, curvature, length_m, speed, foresight_s, going, braking = numbers
    least, there_s, s = math.inf, 0.0, 0.0
    if length_m != 0.0 and waits.any():
        there_s = speed / braking + abs(length_m) / speed
    for k in range(int((foresight_s + there_s) / STEP_S) + 1):
        time_s = k * STEP_S
        if k > 0:
            left_m = length_m - s
            wanted = math.copysign(min(speed, math.sqrt(2 * braking * abs(left_m))), left_m)
            wanted = wanted if length_m != 0.0 and abs(left_m) > 0.005 else 0.0
            going += min(max(wanted - going, -braking * STEP_S), braking * STEP_S)
            s += going * STEP_S
        x, y, heading = along_arc(s, curvature)
        cos, sin = math.cos(heading), math.sin(heading)
        for i in range(points.shape[0]):
            walked_s = max(time_s - there_s, 0.0) if waits[i] else time_s
            dx = points[i, 0] + velocity[i, 0] * walked_s - x
            dy = points[i, 1] + velocity[i, 1] * walked_s - y
            least = min(least, clearance_m(hull, pad_m, cos * dx + sin * dy, cos * dy - sin * dx))
    return least
