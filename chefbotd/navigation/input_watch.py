"""Checks that a step has a pose and scans. Without them the robot stands, and after a while the goal ends."""

import math
from typing import Final

from chefbotd.core.record import Record
from chefbotd.navigation.parameters import NavigationParameters
from chefbotd.navigation.reports import PoseStatus, StepInput
from chefbotd.navigation.states import End

SCAN_FAULT_S: Final = 10.0
"""After so much longer without a scan the goal ends."""

POSE_SILENT_S: Final = 0.4
"""With odometry that is older the robot asks to stand: a board that was silent must not go on as before."""

LOST_S: Final = 20.0
"""A robot that does not know where it is stands, and after so long the goal ends."""

BRAKING_S = 0.05
"""So long after its delay the wheels have nearly stopped."""


class Missing(Record, frozen=True):
    """Since when the robot does not know where it is, and for how long scans are missing; None: they are not.

    The absence of scans is counted by steps: a computer that stood still proves nothing.
    """

    lost_since_s: float | None = None
    without_scan_s: float | None = None
    brakes_until_s: float = -math.inf
    """After odometry was silent the robot first stands: it went on as before, whatever it was asked for."""


class Watched(Record, frozen=True):
    """What is missing now; why the robot stands ("": it can drive), and how the goal ends if that took too long.

    ``is_over`` says that something was missing at the last step, and is there again.
    """

    missing: Missing
    stands: str = ""
    end: End | None = None
    reason: str = ""
    is_over: bool = False


def watched(params: NavigationParameters, last: Missing, now: StepInput, scan_stamp_s: float) -> Watched:
    """One step, with the time of the last scan."""
    if now.status is PoseStatus.LOST:
        return _lost(params, last, now)
    is_found = last.lost_since_s is not None or last.brakes_until_s > -math.inf
    if now.now_s - scan_stamp_s < params.scan_silent_s:
        until_s = last.brakes_until_s
        if now.pose_age_s >= POSE_SILENT_S:
            until_s = now.now_s + params.follower.delay_s + BRAKING_S
        if now.now_s < until_s:
            return Watched(Missing(brakes_until_s=until_s), "waits, because no odometry arrives")
        return Watched(Missing(), is_over=is_found or last.without_scan_s is not None)
    without_scan_s = now.dt_s + (last.without_scan_s or 0.0)
    missing, stands = Missing(without_scan_s=without_scan_s), "waits, because no scan arrives"
    if without_scan_s < SCAN_FAULT_S:
        return Watched(missing, stands, is_over=is_found)
    told = f"fault: no scan arrived for {SCAN_FAULT_S:.0f} s"
    return Watched(missing, stands, End.FAULT, told, is_over=is_found)


def _lost(params: NavigationParameters, last: Missing, now: StepInput) -> Watched:
    since_s = now.now_s if last.lost_since_s is None else last.lost_since_s
    missing, stands = Missing(lost_since_s=since_s), "waits, because its pose is not known"
    if now.now_s - since_s < LOST_S:
        return Watched(missing, stands)
    told = f"lost: for {LOST_S:.0f} s the pose of the robot was not known"
    return Watched(missing, stands, End.LOST, told)
