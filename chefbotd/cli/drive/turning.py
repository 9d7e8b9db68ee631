"""Turning in place to a heading, over a link that shows what was asked some time later.

What has been asked and is not yet shown is taken as turned already (a Smith predictor, with the command for its
model), so the robot is told to stop before odometry says that it has arrived. How long it takes to show (the lead)
differs between boards by several times, and is learned: where a stop comes out wrong, by as much as that. Between two
tries the robot stands, so that nothing is left over from the one before. A robot that sticks is pushed faster at the
next try.
"""

import math
from dataclasses import dataclass, replace

from pydantic import Field

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.core.parameters import Parameters


class TurnParameters(Parameters):
    """How a turn slows down, and when it is done.

    It goes at ``rate_rad_s``, slows by ``deceleration_rad_s2`` and approaches at ``creep_rad_s``. Done is a robot that
    stands within ``tolerance_rad``; one that does not after ``tries``, or ``patience_s`` after the time that the turn
    would take without a fault, will not.
    """

    rate_rad_s: float = Field(1.2, gt=0)
    deceleration_rad_s2: float = Field(1.0, gt=0)
    creep_rad_s: float = Field(0.15, gt=0)
    tolerance_rad: float = Field(0.008, gt=0)
    lead_s: float = Field(0.2, ge=0)
    longest_lead_s: float = Field(1.0, gt=0)
    tries: int = Field(12, ge=1)
    patience_s: float = Field(15.0, gt=0)


@dataclass(frozen=True, slots=True)
class Try:
    """One approach: to the left (1) or the right (-1; 0: not yet begun), from where, and since when.

    ``asked`` is what was asked of late, oldest first: since when, and the rate. ``stopped_s`` is when it was told to
    stop.
    """

    way: int = 0
    from_rad: float = 0.0
    began_s: float = 0.0
    asked: tuple[tuple[float, float], ...] = ()
    stopped_s: float | None = None


@dataclass(frozen=True, slots=True)
class Turn:
    """A turn under way: when it began, how much there was to turn, the tries so far, and what was learned."""

    began_s: float
    whole_rad: float
    lead_s: float
    creep_rad_s: float
    tries: int = 1
    now: Try = Try()


SETTLE_S = 0.15
"""After the lead, so long for the wheels to come to rest, and for their mean speed to show it."""

LEARNED_SHARE = 0.7
STUCK_S = 0.5
"""A robot that stands so long after the lead, although it was asked to turn, sticks."""

STUCK_SHARE, PUSH = 0.3, 1.4
"""A try that did less than this share of its way is followed by one that creeps so many times faster."""


def begin(params: TurnParameters, now_s: float, left_rad: float, lead_s: float | None = None) -> Turn:
    """A turn of ``left_rad`` (CCW positive); ``lead_s`` is what an earlier one has learned."""
    return Turn(now_s, abs(left_rad), params.lead_s if lead_s is None else lead_s, params.creep_rad_s)


def step(
    params: TurnParameters, turn: Turn, now_s: float, left_rad: float, *, stands: bool
) -> tuple[Turn, float | None]:
    """What to ask now (rad/s, CCW positive; None: done), with ``left_rad`` to go as odometry shows it.

    Raises:
        ProgramError: the turn does not come to its end.
    """
    _check(params, turn, now_s, left_rad)
    attempt = turn.now
    if attempt.stopped_s is not None:
        if not stands or now_s - attempt.stopped_s < turn.lead_s + SETTLE_S:
            return turn, 0.0
        if abs(left_rad) <= params.tolerance_rad:
            return turn, None
        turn = _learn(params, turn, left_rad)
        attempt = turn.now
    if attempt.way == 0:
        if stands and abs(left_rad) <= params.tolerance_rad:
            return turn, None
        attempt = Try(1 if left_rad > 0 else -1, left_rad, now_s)
    to_come_rad = left_rad - _pending_rad(attempt, now_s, turn.lead_s)
    sticks = stands and now_s - attempt.began_s > turn.lead_s + STUCK_S
    if attempt.way * to_come_rad <= 0 or sticks:
        return replace(turn, now=replace(attempt, stopped_s=now_s)), 0.0
    rate = attempt.way * _rate(params, turn, abs(to_come_rad))
    asked = (*_within(attempt.asked, now_s - turn.lead_s), (now_s, rate))
    return replace(turn, now=replace(attempt, asked=asked)), rate


def _rate(params: TurnParameters, turn: Turn, distance_rad: float) -> float:
    """The rate from which the deceleration stops within the distance, no slower than creeping."""
    slowing = math.sqrt(2 * params.deceleration_rad_s2 * distance_rad)
    return max(min(slowing, params.rate_rad_s), turn.creep_rad_s)


def _within(asked: tuple[tuple[float, float], ...], since_s: float) -> tuple[tuple[float, float], ...]:
    """What was asked since then: the last one before it, too, was still in force."""
    first = sum(stamp_s <= since_s for stamp_s, _ in asked)
    return asked[max(first - 1, 0) :]


def _pending_rad(attempt: Try, now_s: float, lead_s: float) -> float:
    """How far what was asked in the last ``lead_s`` turns the robot, which odometry does not show yet."""
    pending_rad, until_s = 0.0, now_s
    for stamp_s, rate in reversed(attempt.asked):
        pending_rad += rate * max(0.0, until_s - max(stamp_s, now_s - lead_s))
        until_s = min(until_s, stamp_s)
    return pending_rad


def _learn(params: TurnParameters, turn: Turn, left_rad: float) -> Turn:
    """The next try, after one that ended elsewhere: beyond the heading the lead was too short, before it too long."""
    attempt = turn.now
    beyond_rad = -attempt.way * left_rad
    turned_rad = abs(attempt.from_rad - left_rad)
    if turned_rad < STUCK_SHARE * abs(attempt.from_rad):
        creep_rad_s = min(PUSH * turn.creep_rad_s, params.rate_rad_s)
        return replace(turn, creep_rad_s=creep_rad_s, tries=turn.tries + 1, now=Try())
    slowing, creep = params.deceleration_rad_s2, turn.creep_rad_s
    late_s = (
        math.sqrt(creep**2 + 2 * slowing * abs(beyond_rad)) - creep
    ) / slowing  # at the end of the approach
    change_s = LEARNED_SHARE * math.copysign(late_s, beyond_rad)
    lead_s = min(max(turn.lead_s + change_s, 0.0), params.longest_lead_s)
    return replace(turn, lead_s=lead_s, creep_rad_s=params.creep_rad_s, tries=turn.tries + 1, now=Try())


def _check(params: TurnParameters, turn: Turn, now_s: float, left_rad: float) -> None:
    took_s = now_s - turn.began_s
    ideal_s = turn.whole_rad / params.rate_rad_s + params.rate_rad_s / params.deceleration_rad_s2
    if turn.tries <= params.tries and took_s <= ideal_s + params.patience_s:
        return
    left, whole, most = (math.degrees(rad) for rad in (left_rad, turn.whole_rad, params.tolerance_rad))
    told = (
        f"the turn does not come to its end: {left:+.1f}° left of {whole:.0f}° after {took_s:.0f} s "
        f"and {min(turn.tries, params.tries)} tries (expected within {most:.1f}°); "
        "see what 'chefbotctl status' says holds the robot, and its gains"
    )
    raise ProgramError(Exit.NOT_DONE, told)
