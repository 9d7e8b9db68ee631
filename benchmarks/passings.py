"""Somebody who looks at nothing passes a robot that drives, in a corridor or out of a door: how near, how fast, touches.

Each seed is one passing, with the robot of ``benchmarks.situations``. It ends when he has passed, and costs less than a
second of one core. ``python -m benchmarks.passings 0 250`` runs the passings 0 to 249, so that several cores share them.
"""

import math
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from benchmarks.figures import Figure, Outcome
from benchmarks.situations import Situation
from chefbotd.components.navigation.algorithms.path import Goal
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.mapping.algorithms.slam.flat import box, wall
from tests.chefbotd.components.navigation.algorithms.drives import Person
from tests.chefbotd.components.navigation.algorithms.grids import rasterised

PASSINGS, QUICK_PASSINGS = 1000, 10
CREEPS_M_S, CLOSE_M, LOOK_S = 0.1, 0.1, 0.04
MOVES_M_S = 0.02
CORRIDOR_M, DOOR_M = 1.6, 0.9
JUST_S = 0.3
PASSED_M = 0.6
"""Who was nearer than now by this has passed."""


@dataclass(frozen=True, slots=True)
class Passing:
    """What happened in one.

    ``fast_s`` is how long the robot was faster than creeping with less than 0.1 m between them while the gap did not
    open, ``fastest_m_s`` its highest speed then. ``least_m`` is the least gap, ``moving_m`` that while it moved.
    ``touches`` says whether it moved when they touched first, ``walked_into`` whether he walked into it while it stood,
    ``just_stood`` whether it had then moved within the last 0.3 s.
    """

    is_reached: bool
    fast_s: float
    fastest_m_s: float
    least_m: float
    moving_m: float
    touches: int
    walked_into: int
    just_stood: int


def passed(seed: int, *, until_reached: bool = False) -> Passing:
    """In a corridor of 1.6 m, along it or out of a door: somebody walks along it, anywhere in it, and never yields.

    It ends when he has passed or, with ``until_reached``, at the goal; he walks to and fro meanwhile.
    """
    drive, goal = _begun(seed)
    if until_reached:
        drive.sent(goal, 60.0)
    else:
        drive.navigator.navigate_to((goal,))
        _run_until_passed(drive)
    gaps = np.array([(each.people_m, abs(each.speed_m_s)) for each in drive.passed])
    opens = np.diff(gaps[:, 0], append=gaps[-1, 0]) > 0
    before = np.cumsum(gaps[:, 0] < 0) == 0  # he is no solid thing: what follows a touch is none of its own
    fast = (gaps[:, 0] < CLOSE_M) & (gaps[:, 1] > CREEPS_M_S) & ~opens & before
    moving = (gaps[:, 1] > MOVES_M_S) & before
    first = np.flatnonzero(~before)[:1]
    is_own = bool(len(first)) and gaps[max(first[0] - 1, 0) : first[0] + 1, 1].min() > MOVES_M_S
    is_walked_into = bool(len(first)) and not is_own
    lately = gaps[max(first[0] - round(JUST_S / LOOK_S), 0) : first[0], 1] if is_walked_into else gaps[:0, 1]
    return Passing(
        bool(drive.ended) and drive.ended[-1].end == "reached",
        float(fast.sum()) * LOOK_S,
        float(gaps[fast, 1].max(initial=0.0)),
        float(gaps[:, 0].min()),
        float(gaps[moving, 0].min(initial=math.inf)),
        int(is_own),
        int(is_walked_into),
        int(lately.max(initial=0.0) > MOVES_M_S),
    )


def _begun(seed: int) -> tuple[Situation, Goal]:
    chance = np.random.default_rng(seed)
    walls = np.vstack(
        [box(0, 0, 9.0, 3.6), wall((0, 2.0), (3.5, 2.0)), wall((3.5 + DOOR_M, 2.0), (9.0, 2.0))]
    )
    y_m, speed_m_s = 2.0 + float(chance.uniform(0.35, CORRIDOR_M - 0.35)), float(chance.uniform(0.4, 1.2))
    way = np.array([[0.3, y_m], [8.7, y_m]])
    if chance.random() < 0.5:
        way = way[::-1]
    through_door = seed % 2 == 0
    if through_door:
        start, goal = Pose2D(3.95 + float(chance.uniform(-0.3, 0.3)), 0.9, math.pi / 2), Goal(7.0, 2.8, 0.0)
    else:
        start, goal = Pose2D(2.0, 2.0 + float(chance.uniform(0.4, 1.2)), 0.0), Goal(7.5, 2.8, 0.0)
    walker = Person(way, speed_m_s, 0.22, is_blind=True, along_m=float(chance.uniform(0.0, 1.0)))
    if not through_door and way[0, 0] < 1.0:  # from behind: it begins behind the robot
        walker.along_m = 0.0
    drive = Situation(rasterised(walls, 9.0, 3.6), walls, start, [walker], seed=seed, scan_age_s=0.1)
    return drive, goal


def _run_until_passed(drive: Situation) -> None:
    least_m = math.inf
    while not drive.ended and drive.people[0].direction > 0:
        drive.tick()
        gap_m = drive.people_m()
        least_m = min(least_m, gap_m)
        if gap_m > least_m + PASSED_M:
            break


def run(*, quick: bool = False) -> Outcome:
    """A touch of a robot that moves is wrong."""
    return found(passed(seed) for seed in range(QUICK_PASSINGS if quick else PASSINGS))


def found(passings: Iterable[Passing]) -> Outcome:
    """The figures of some passings."""
    each = tuple(passings)
    touches = sum(one.touches for one in each)
    count = _counter(each)
    figures = (
        Figure("touches of a robot that moves", touches, "", 0),
        Figure("people who walk into a robot that stands", sum(one.walked_into for one in each), ""),
        Figure("of these, that had moved within 0.3 s", sum(one.just_stood for one in each), ""),
        Figure("nearer than 0.1 m", count(lambda one: one.least_m < CLOSE_M), ""),
        Figure("of these, faster than 0.1 m/s while the gap did not open", count(lambda one: one.fast_s > 0), ""),
        Figure("longest time so", max(one.fast_s for one in each), "s"),
        Figure("highest speed so", max(one.fastest_m_s for one in each), "m/s"),
        Figure("least gap while it moves", min(one.moving_m for one in each), "m"),
    )  # fmt: skip
    named = tuple(
        Figure(f"{len(each)} passings, {figure.name}", figure.value, figure.unit, figure.target)
        for figure in figures
    )
    faults = (f"{touches} of {len(each)} people were touched by a robot that moved",) if touches else ()
    return Outcome(named, faults=faults)


def _counter(passings: tuple[Passing, ...]) -> Callable[[Callable[[Passing], bool]], int]:
    return lambda is_so: sum(is_so(one) for one in passings)


if __name__ == "__main__":
    for number in range(int(sys.argv[1]), int(sys.argv[2])):
        print(number, passed(number), flush=True)
