"""Detects that the robot makes no progress, and tries to recover, one action after another, until it gives up."""

import math
from enum import StrEnum
from typing import Final

import numpy as np

from chefbotd.components.navigation.algorithms.follower import backwards
from chefbotd.components.navigation.algorithms.interface import NavigationParameters, StepInput
from chefbotd.components.navigation.algorithms.steering import Control
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence

IDLE_S: Final = 6.0
"""A robot that drives and makes no progress for so long is stuck."""

MOVED_M, MOVED_RAD = 0.04, 0.15
"""A robot that moved, or turned, farther than this has made progress."""

STUCK_S: Final = 1.5
"""A robot that is blocked for so long is stuck;"""

WALKER_S: Final = 6.0
"""by a person who walked a moment ago, after so long: until then it waits for him to go on."""

DETOUR_S: Final = 15.0
"""The robot waits for a person on its path as long as the detour would take, and no longer than this,"""

LEAVES_S: Final = 30.0
"""if a person walked there within this time, and nothing has stood there for longer."""

LOOK_S: Final = 1.0
BACK_OUT_M: Final = 0.35
BACK_OUT_S: Final = 6.0
CLOSED_S: Final = 45.0
"""A place that was blocked counts as closed for so long when another path is searched."""

CLOSED_RADIUS_M: Final = 0.15
WAIT_S: Final = 12.0
ASK_S: Final = 12.0
PATIENCE_S: Final = 60.0
"""A path that opens and closes, as where people go to and fro, is tried for so long at least."""

AGAIN_S: Final = 1.0
"""While the robot waits it plans again after this time."""

PROGRESS_M: Final = 0.6

Trail = tuple[tuple[float, float], ...]
"""Points (x, y) of the grid's frame, the newest last."""

SPACING_M = 0.05
MOST_POINTS = 41
"""With their spacing: 2 m."""

LEAST_POINTS = 4
"""With fewer the robot does not know where it came from."""


NO_PROGRESS: Final = Sentence("navigation.no_progress", "the robot makes no progress")


class InTheWay(Record, frozen=True):
    """What blocks the robot: where it is, as a part of a sentence, and whether it is a person who will walk on."""

    where: str
    walks: bool


class LastProgress(Record, frozen=True):
    """When and where (in the map) the robot last made progress, and since when it has been blocked."""

    moved_s: float
    pose: Pose2D
    blocked_since_s: float | None = None


class ProgressCheck(Record, frozen=True):
    """The last progress; why the robot waits from now on, whether it drives again, why it is stuck ("": it is not)."""

    progress: LastProgress
    waits: str = ""
    drives_again: bool = False
    stuck: str = ""


def checked_progress(
    params: NavigationParameters, last: LastProgress, inputs: StepInput, in_the_way: InTheWay | None
) -> ProgressCheck:
    """One step of driving, with what blocks the robot now."""
    if in_the_way is None:
        free = replace(last, blocked_since_s=None)
        return _count_progress(
            params, ProgressCheck(free, drives_again=last.blocked_since_s is not None), inputs
        )
    why = Sentence("navigation.in_the_way", "something is in the way{where}", where=in_the_way.where)
    waits: str = ""
    since_s = last.blocked_since_s
    if since_s is None:
        since_s, waits = inputs.now_s, Sentence("navigation.waits_because", "waits, because {why}", why=why)
    blocked = replace(last, blocked_since_s=since_s)
    patience_s = WALKER_S if in_the_way.walks else STUCK_S * params.slower
    if inputs.now_s - since_s >= patience_s:
        return ProgressCheck(blocked, waits, stuck=why)
    return _count_progress(params, ProgressCheck(blocked, waits), inputs, why)


def _count_progress(
    params: NavigationParameters,
    check: ProgressCheck,
    inputs: StepInput,
    why: str = NO_PROGRESS,
) -> ProgressCheck:
    """The same, with the progress that the robot has made, or why it is stuck without any."""
    last = check.progress
    moved_m = math.hypot(inputs.pose.x_m - last.pose.x_m, inputs.pose.y_m - last.pose.y_m)
    turned_rad = abs(math.remainder(inputs.pose.heading_rad - last.pose.heading_rad, math.tau))
    if moved_m > MOVED_M or turned_rad > MOVED_RAD:
        return replace(check, progress=replace(last, moved_s=inputs.now_s, pose=inputs.pose))
    if inputs.now_s - last.moved_s > IDLE_S * params.slower:
        return replace(check, stuck=why)
    return check


class Action(StrEnum):
    """What is tried, in this order."""

    LOOK = "look"
    BACK_OUT = "back_out"
    OTHER_WAY = "other_way"
    WAIT = "wait"
    ASK = "ask"


ORDER = tuple(Action)
SENTENCES = {
    Action.LOOK: Sentence("navigation.looks_again", "stops and looks again"),
    Action.BACK_OUT: Sentence("navigation.backs_out", "backs out the way it came"),
    Action.OTHER_WAY: Sentence("navigation.other_path", "looks for another path"),
    Action.WAIT: Sentence("navigation.waits_for_way", "waits for the way to become free"),
    Action.ASK: Sentence("navigation.asks_people", "asks people to clear the way"),
}


class Recovery(Record, frozen=True):
    """The present action and when it began; when and where (distance to go) the robot became stuck."""

    action: Action
    action_began_s: float
    began_s: float
    left_m: float


def start_recovery(last: Recovery | None, now_s: float, left_m: float) -> Recovery | None:
    """Begin with the first action or, without progress since the last recovery, with the one after its last action.

    None: no action is left and the patience is over, so the goal is blocked.
    """
    if last is None or last.left_m - left_m > PROGRESS_M:
        return Recovery(Action.LOOK, now_s, now_s, left_m)
    following = after(last, now_s)
    if following is None and now_s - last.began_s < PATIENCE_S:
        return replace(last, action=Action.WAIT, action_began_s=now_s)
    return following


def after(recovery: Recovery, now_s: float) -> Recovery | None:
    """The next thing to try; None after the last."""
    place = ORDER.index(recovery.action) + 1
    return None if place == len(ORDER) else replace(recovery, action=ORDER[place], action_began_s=now_s)


def is_over(recovery: Recovery, now_s: float, slower: float = 1.0) -> bool:
    """Whether what is tried has had its time; a robot that is ``slower`` takes so many times as long."""
    times = {
        Action.LOOK: LOOK_S * slower,
        Action.BACK_OUT: BACK_OUT_S * slower,
        Action.OTHER_WAY: 0.0,
        Action.WAIT: WAIT_S,
        Action.ASK: ASK_S,
    }
    return now_s - recovery.action_began_s >= times[recovery.action]


def extend_trail(trail: Trail, pose: Pose2D, twist: Twist2D) -> Trail:
    """The trail of a robot that is here (in the grid's frame) and drives so."""
    if twist.linear_m_s <= 0:
        return trail
    if trail and math.hypot(pose.x_m - trail[-1][0], pose.y_m - trail[-1][1]) <= SPACING_M:
        return trail
    return (*trail[-(MOST_POINTS - 1) :], (pose.x_m, pose.y_m))


def back_out(
    params: NavigationParameters, trail: Trail, began: Pose2D, inputs: StepInput, surroundings: Surroundings
) -> Twist2D | None:
    """A twist backwards; None when it is far enough, or if there is no room or no trail.

    ``began`` is where the robot was in the map when it began to back out.
    """
    away_m = math.hypot(inputs.pose.x_m - began.x_m, inputs.pose.y_m - began.y_m)
    if away_m >= BACK_OUT_M or len(trail) < LEAST_POINTS:
        return None
    control = Control(params.follower, params.outline, surroundings, inputs.last, inputs.dt_s)
    done = backwards(control, np.array(trail[::-1]))
    return None if done.is_blocked else done.twist
