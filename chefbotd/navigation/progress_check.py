"""Detects that the robot makes no progress: it is blocked, or stays in one place, for too long."""

import math
from typing import Final

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record, replace
from chefbotd.navigation.parameters import NavigationParameters
from chefbotd.navigation.recovery import STUCK_S, WALKER_S
from chefbotd.navigation.reports import StepInput

IDLE_S: Final = 6.0
"""A robot that drives and does not come on for so long is stuck."""

MOVED_M, MOVED_RAD = 0.04, 0.15
"""A robot that moved, or turned, farther than this has come on."""


class InTheWay(Record, frozen=True):
    """What blocks the robot: where it is, as a part of a sentence, and whether it is somebody who will walk on."""

    where: str
    walks: bool


class LastProgress(Record, frozen=True):
    """When and where (in the map) the robot came on last, and since when it has been blocked."""

    moved_s: float
    pose: Pose2D
    blocked_since_s: float | None = None


class Checked(Record, frozen=True):
    """How the robot comes on; why it waits from now on, whether it drives again, and why it is stuck ("": it is not)."""

    progress: LastProgress
    waits: str = ""
    drives_again: bool = False
    stuck: str = ""


def checked(
    params: NavigationParameters, last: LastProgress, now: StepInput, in_the_way: InTheWay | None
) -> Checked:
    """One step of driving, with what blocks the robot now."""
    if in_the_way is None:
        free = replace(last, blocked_since_s=None)
        return _moved(params, Checked(free, drives_again=last.blocked_since_s is not None), now)
    told, waits = f"something is in the way{in_the_way.where}", ""
    since_s = last.blocked_since_s
    if since_s is None:
        since_s, waits = now.now_s, f"waits, because {told}"
    blocked = replace(last, blocked_since_s=since_s)
    patience_s = WALKER_S if in_the_way.walks else STUCK_S * params.slower
    if now.now_s - since_s >= patience_s:
        return Checked(blocked, waits, stuck=told)
    return _moved(params, Checked(blocked, waits), now)


def _moved(params: NavigationParameters, found: Checked, now: StepInput) -> Checked:
    """The same, with where the robot came on last."""
    last = found.progress
    moved_m = math.hypot(now.pose.x_m - last.pose.x_m, now.pose.y_m - last.pose.y_m)
    turned_rad = abs(math.remainder(now.pose.heading_rad - last.pose.heading_rad, math.tau))
    if moved_m > MOVED_M or turned_rad > MOVED_RAD:
        return replace(found, progress=replace(last, moved_s=now.now_s, pose=now.pose))
    if now.now_s - last.moved_s > IDLE_S * params.slower:
        return replace(found, stuck="the robot makes no progress")
    return found
