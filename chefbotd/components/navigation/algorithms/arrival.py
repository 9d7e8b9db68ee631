"""Watches, after a goal was reached, whether the pose by which it was reached turns out to be wrong.

In a room that looks like another nothing tells which one it is, until the robot leaves it. So the arrival is kept, with
the odometry of that moment: where the pose is found to be elsewhere later, that tells where the robot stood then.
"""

import math
from enum import StrEnum
from typing import Annotated, Final

from msgspec import Meta

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence

WRONG_M: Final = 0.3
"""A pose that jumps by more than this was wrong before."""

UNSURE_S: Final = 2.0
"""An arrival is doubted when the pose has been uncertain for so long; at once, when it is searched or lost."""

MOST_WAY_M: Final = 30.0
"""An arrival is watched until the robot has driven so far since: what odometry says of it gets worse."""


class ArrivalState(StrEnum):
    """What is thought of an arrival now."""

    DOUBTED = "doubted"
    CONFIRMED = "confirmed"
    WRONG = "wrong"


class ArrivalData(Record, frozen=True):
    """What is thought now of a goal that was reached, and why; where it is wrong, where the robot stood then."""

    goal: int
    arrival: ArrivalState
    reason: str
    off_m: Annotated[
        float | None, Meta(description="how far from there, if nobody moved the robot since; null: not known")
    ] = None
    x_m: float | None = None
    y_m: float | None = None


class Arrival(Record, frozen=True):
    """The last goal that was reached, where odometry had the robot then, and how it was placed in the map, while sure.

    ``last_odom`` and ``way_m`` are of the way since then. The pose has been doubtful since ``doubtful_since_s``.
    """

    goal: int
    odom_from_base: Pose2D
    map_from_odom: Pose2D
    last_odom: Pose2D
    way_m: float = 0.0
    doubtful_since_s: float | None = None
    is_doubted: bool = False


def begin_arrival(goal: int, map_from_odom: Pose2D, odom_from_base: Pose2D) -> Arrival:
    """The robot has just reached a goal."""
    return Arrival(goal, odom_from_base, map_from_odom, odom_from_base)


def watch_arrival(
    arrival: Arrival,
    now_s: float,
    map_from_odom: Pose2D | None,
    odom_from_base: Pose2D,
    *,
    is_sure: bool,
    is_uncertain: bool = False,
) -> tuple[Arrival | None, ArrivalData | None]:
    """One step: what is known of the arrival (None: no more), and what is thought of it, where that has changed.

    ``map_from_odom`` is how the robot is placed now, if it is placed; ``is_uncertain`` says that this may be wrong.
    """
    before = arrival.last_odom
    way_m = arrival.way_m + math.hypot(odom_from_base.x_m - before.x_m, odom_from_base.y_m - before.y_m)
    if way_m > MOST_WAY_M and not arrival.is_doubted:
        return None, None
    arrival = replace(arrival, last_odom=odom_from_base, way_m=way_m)
    if not is_sure or map_from_odom is None:
        return _doubt(arrival, now_s, is_uncertain=is_uncertain)
    expected, placed = arrival.map_from_odom.compose(odom_from_base), map_from_odom.compose(odom_from_base)
    if math.hypot(expected.x_m - placed.x_m, expected.y_m - placed.y_m) > WRONG_M:
        return None, _wrong(arrival, map_from_odom)
    arrival = replace(arrival, map_from_odom=map_from_odom, doubtful_since_s=None)
    if not arrival.is_doubted:
        return arrival, None
    confirmed = ArrivalData(
        arrival.goal,
        ArrivalState.CONFIRMED,
        Sentence("navigation.arrival_right", "reached: the pose was doubted, and is right"),
    )
    return replace(arrival, is_doubted=False), confirmed


def _doubt(arrival: Arrival, now_s: float, *, is_uncertain: bool) -> tuple[Arrival, ArrivalData | None]:
    since_s = now_s if arrival.doubtful_since_s is None else arrival.doubtful_since_s
    arrival = replace(arrival, doubtful_since_s=since_s)
    if arrival.is_doubted or (is_uncertain and now_s - since_s < UNSURE_S):
        return arrival, None
    why = Sentence(
        "navigation.arrival_doubted",
        "the robot may not have been at its goal: its pose, by which it was reached, is doubted now",
    )
    return replace(arrival, is_doubted=True), ArrivalData(arrival.goal, ArrivalState.DOUBTED, why)


def _wrong(arrival: Arrival, map_from_odom: Pose2D) -> ArrivalData:
    """By the odometry of then; who carried the robot since has moved it, too."""
    then, stood = (at.compose(arrival.odom_from_base) for at in (arrival.map_from_odom, map_from_odom))
    off_m = math.hypot(stood.x_m - then.x_m, stood.y_m - then.y_m)
    why = Sentence(
        "navigation.arrival_wrong",
        "its pose was wrong: the robot was not at its goal, but at ({x_m:.2f}, {y_m:.2f}), {off_m:.2f} m from where it "
        "took itself to be, unless somebody has moved it since",
        x_m=stood.x_m,
        y_m=stood.y_m,
        off_m=off_m,
    )
    return ArrivalData(arrival.goal, ArrivalState.WRONG, why, off_m, stood.x_m, stood.y_m)
