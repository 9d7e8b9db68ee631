"""Plans how a standing robot evades a person who walks towards it.

Staying and some short arcs, forwards and backwards, are compared by how near the person would come if he walked on as
now, or as before he stopped for the robot. The robot does not flee from a person who is faster: then only a place beside
his path is better than standing.
"""

import math
from collections.abc import Iterator
from itertools import product
from typing import Final

import numpy as np

from chefbotd.components.navigation.algorithms.arcs import KEEP_M, along_arc, check_arc
from chefbotd.components.navigation.algorithms.grid import Flags, Floats
from chefbotd.components.navigation.algorithms.outline import Footprint, clearance_m
from chefbotd.components.navigation.algorithms.surroundings import Surroundings, standing_only
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.geometry import STANDING, Twist2D
from chefbotd.core.record import Record

CURVATURES = (0.0, -1.5, 1.5, -4.0, 4.0)
LENGTHS_M = (0.2, 0.35, 0.5, 0.65)
STEP_S = 0.1

HERE_M, NOISE_M = 0.001, 0.01
"""An arc so short shows the present room; where that is less than ``KEEP_M``, only noise may take from it."""


GRAZED_M = 0.1
"""A touch that cannot be avoided is made less deep if it is no deeper than this. The robot does not flee from a person
who walks right over it."""


ROOM_M: Final = 0.12
"""The robot evades a person who will come nearer than this;"""

ENOUGH_M: Final = 0.20
"""more room than this is worth nothing."""

GAIN_M: Final = 0.03
"""It moves only if that leaves so much more room than standing."""

PRICE: Final = 0.04
"""Each metre of moving must gain so many of room."""

TOUCH_M: Final = 0.03
"""To evade a person who would come nearer than this, the robot may come nearer to standing obstacles than ``KEEP_M``:"""

WALL_M: Final = 0.06
"""it keeps at least so far from them."""

FORESIGHT_S: Final = 2.5
"""A person is expected to walk on as now for so long."""

PASSED_S: Final = 4.0
"""No person may come to the place that the robot goes to within this time."""

SPEED_M_S: Final = 0.25
BRAKING_M_S2: Final = 0.75
"""The robot is expected to accelerate and brake so fast, if its limits allow it: three quarters of ChefBot's."""

MOST_M: Final = 0.8
"""From a person who is faster it goes no farther than this from where it stood: he would catch up with it anyhow."""

MOST_IF_SLOWER_M: Final = 3.0

STANDS_S: Final = 1.0
"""A moving robot that a person would touch within this time brakes, unless he would then come nearer,"""

FAST_M_S: Final = 0.4
"""if he is faster than this: anybody slower can be evaded to the end."""


class Agility(Record, frozen=True):
    """How fast the robot's own limits let it gain and lose speed, in m/s²."""

    acceleration_m_s2: float = math.inf
    deceleration_m_s2: float = math.inf


AGILE: Final = Agility()
"""A robot that is held by no limits."""


def evading_twist(
    outline: Footprint,
    surroundings: Surroundings,
    last: Twist2D,
    away_m: float,
    *,
    is_stuck: bool,
    only_touch: bool = False,
    agility: Agility = AGILE,
) -> Twist2D | None:
    """The twist that evades, ``away_m`` from where the robot stood; None: stay.

    It stays if nobody comes too near, or if no place that it can reach is better. With ``only_touch`` it evades only a
    person who would touch it. It evades a person who stopped for it only if it cannot go on itself (``is_stuck``).
    """
    coming = _coming(surroundings, is_stuck=is_stuck)
    if coming is None or away_m > _most_m(coming):
        return None
    standing = standing_only(surroundings)
    search = _Search(outline, last, coming, standing, agility)
    stay_m = search.least_m(0.0, 0.0, FORESIGHT_S)
    if stay_m >= (TOUCH_M if only_touch else ROOM_M):
        return None
    here_m = check_arc(outline, standing, 0.0, HERE_M, SPEED_M_S, 1.0).room_m
    clear = search.best(stay_m, min(KEEP_M, here_m - NOISE_M))
    return clear if clear is not None or stay_m >= TOUCH_M else search.best(stay_m, WALL_M)


class _Coming(Record, frozen=True):
    """Points of walking people in the robot's frame, their velocities, and who waits until the robot stands."""

    points_m: Floats
    velocity_m_s: Floats
    waits: Flags


class _Search(Record, frozen=True):
    """What the arcs are judged by: who comes, and what stands about the robot."""

    outline: Footprint
    last: Twist2D
    coming: _Coming
    standing: Surroundings
    agility: Agility = AGILE

    def least_m(self, curvature: float, length_m: float, within_s: float) -> float:
        """How near anybody comes while the robot goes along an arc, and stands then."""
        going_m_s = self.last.linear_m_s
        gains, brakes = self.agility.acceleration_m_s2, self.agility.deceleration_m_s2
        changes = [min(BRAKING_M_S2, gains), min(BRAKING_M_S2, brakes)]
        motion = [curvature, length_m, SPEED_M_S, within_s, going_m_s, *changes]
        numbers, coming = np.array([self.outline.pad_m, *motion]), self.coming
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


def _coming(surroundings: Surroundings, *, is_stuck: bool) -> _Coming | None:
    """The people to be evaded; None when there is nobody."""
    intent = surroundings.velocity_m_s if surroundings.intent_m_s is None else surroundings.intent_m_s
    walks: Flags = np.asarray(surroundings.velocity_m_s.any(axis=1))
    moving: Flags = np.asarray(intent.any(axis=1)) if is_stuck else walks
    if not moving.any():
        return None
    return _Coming(surroundings.points_m[moving], intent[moving], np.logical_not(walks[moving]))


def _most_m(coming: _Coming) -> float:
    """It goes so far at most."""
    fastest_m_s = math.sqrt(float((coming.velocity_m_s**2).sum(axis=1).max()))
    return MOST_M if fastest_m_s > SPEED_M_S else MOST_IF_SLOWER_M


def _arcs(outline: Footprint, standing: Surroundings, wall_m: float) -> Iterator[tuple[float, float]]:
    """Curvature and length (negative: backwards) of each arc that is free, and stays so far from what stands."""
    for direction, curvature in product((-1.0, 1.0), CURVATURES):
        for length_m in LENGTHS_M:
            arc = check_arc(outline, standing, curvature, direction * length_m, SPEED_M_S, 1.0)
            if arc.free < length_m - 1e-6 or arc.room_m < wall_m:
                break
            yield curvature, direction * length_m


def is_in_the_way(outline: Footprint, surroundings: Surroundings, for_s: float) -> bool:
    """Whether a walking person would come too near to a robot that stood here for so long."""
    return _Search(outline, STANDING, _walking(surroundings), surroundings).least_m(0.0, 0.0, for_s) < ROOM_M


def _walking(surroundings: Surroundings, above_m_s: float = 0.0) -> _Coming:
    """The people who walk now, faster than this, each with his present velocity."""
    walks: Flags = np.asarray(
        np.hypot(surroundings.velocity_m_s[:, 0], surroundings.velocity_m_s[:, 1]) > above_m_s
    )
    return _Coming(
        surroundings.points_m[walks], surroundings.velocity_m_s[walks], np.zeros(int(walks.sum()), np.bool_)
    )


@kernel
def _least_m(hull: Floats, points: Floats, velocity: Floats, waits: Flags, numbers: Floats) -> float:
    """How near the points come while the robot goes along an arc (backwards with a negative length), and stands then.

    It begins with its present speed, and changes that as fast as it can. A person who waits goes on when it stands.
    """
    pad_m, curvature, length_m, speed, foresight_s, going, gains, brakes = numbers
    least, arrives_s, s = math.inf, 0.0, 0.0
    if length_m != 0.0 and waits.any():
        arrives_s = (speed / gains + speed / brakes) / 2 + abs(length_m) / speed
    for k in range(int((foresight_s + arrives_s) / STEP_S) + 1):
        time_s = k * STEP_S
        if k > 0:
            left_m = length_m - s
            target = math.copysign(min(speed, math.sqrt(2 * brakes * abs(left_m))), left_m)
            target = target if length_m != 0.0 and abs(left_m) > 0.005 else 0.0
            change = gains if abs(target) > abs(going) and target * going >= 0.0 else brakes
            going += min(max(target - going, -change * STEP_S), change * STEP_S)
            s += going * STEP_S
        x, y, heading = along_arc(s, curvature)
        cos, sin = math.cos(heading), math.sin(heading)
        for i in range(points.shape[0]):
            walked_s = max(time_s - arrives_s, 0.0) if waits[i] else time_s
            dx = points[i, 0] + velocity[i, 0] * walked_s - x
            dy = points[i, 1] + velocity[i, 1] * walked_s - y
            least = min(least, clearance_m(hull, pad_m, cos * dx + sin * dy, cos * dy - sin * dx))
    return least


def safest(
    outline: Footprint,
    surroundings: Surroundings,
    last: Twist2D,
    twist: Twist2D | None,
    agility: Agility = AGILE,
) -> Twist2D | None:
    """The twist; None, to brake, if a person would soon touch a robot that drives so, and comes no nearer then."""
    people = _walking(surroundings, FAST_M_S)
    if twist is None or abs(twist.linear_m_s) < 1e-3 or not len(people.points_m):
        return twist
    search = _Search(outline, last, people, surroundings, agility)
    length_m = math.copysign(_without_braking_m(agility, STANDS_S), twist.linear_m_s)
    driving_m = search.least_m(twist.angular_rad_s / twist.linear_m_s, length_m, STANDS_S)
    stands = driving_m < TOUCH_M and search.least_m(0.0, 0.0, STANDS_S) >= driving_m
    return None if stands else twist


def _without_braking_m(agility: Agility, within_s: float) -> float:
    """An arc so long that the robot does not brake for its end within that time."""
    return SPEED_M_S * (within_s + SPEED_M_S / min(BRAKING_M_S2, agility.deceleration_m_s2))


def will_be_touched(
    outline: Footprint, surroundings: Surroundings, last: Twist2D, twist: Twist2D, agility: Agility = AGILE
) -> bool:
    """Whether somebody fast would walk into the robot where it drives on as now, and nearly as far where it stands."""
    people = _walking(surroundings, FAST_M_S)
    if not len(people.points_m) or twist.linear_m_s < 1e-3:
        return False
    search = _Search(outline, last, people, surroundings, agility)
    stay_m = search.least_m(0.0, 0.0, FORESIGHT_S)
    if stay_m >= TOUCH_M:
        return False
    length_m = _without_braking_m(agility, FORESIGHT_S)
    driving_m = search.least_m(twist.angular_rad_s / twist.linear_m_s, length_m, FORESIGHT_S)
    return driving_m < min(0.0, stay_m + GAIN_M)
