"""Turns in place to a heading, although odometry shows a command only after a delay.

A Smith predictor, whose model is the command itself, adds the rotation that was commanded and is not visible yet. The
robot is therefore told to stop before odometry shows the goal. The delay differs between boards by several times, so it
is learned: each stop that misses the goal corrects it. The robot stands still between two tries. If it did not move,
the next try is faster.
"""

import math
from dataclasses import dataclass, replace

from pydantic import Field

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.core.parameters import Parameters


class TurnParameters(Parameters):
    """How a turn slows down, and when it is done.

    The robot turns at ``rate_rad_s``, decelerates by ``deceleration_rad_s2`` and approaches the goal at ``creep_rad_s``.
    The turn is done when the robot stands within ``tolerance_rad`` of the goal, after the last of the ``tries`` within
    twice as much. It fails if that is missed, or ``patience_s`` after the time that a turn without a fault takes.
    """

    rate_rad_s: float = Field(1.2, gt=0)
    deceleration_rad_s2: float = Field(1.0, gt=0)
    creep_rad_s: float = Field(0.15, gt=0)
    tolerance_rad: float = Field(0.008, gt=0)
    delay_s: float = Field(0.2, ge=0)
    max_delay_s: float = Field(1.0, gt=0)
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
    delay_s: float
    creep_rad_s: float
    tries: int = 1
    now: Try = Try()


SETTLE_S = 0.15
"""Time after the delay until the wheels stand and their mean speed shows it."""

LEARNED_SHARE = 0.7
STUCK_S = 0.5
"""A robot is stuck when it still stands this long after the delay, although it was told to turn."""

STUCK_SHARE, PUSH = 0.3, 1.4
"""A try that covered less than ``STUCK_SHARE`` of its rotation is repeated with a creep speed ``PUSH`` times higher."""

LAST_RESORT = 2.0
"""The last try may miss by this multiple of the tolerance: wheels that are dragged sideways stick, and a push that moves
them at all can turn the robot from one side of the goal to the other."""


def begin(params: TurnParameters, now_s: float, remaining_rad: float, delay_s: float | None = None) -> Turn:
    """A turn of ``remaining_rad`` (CCW positive). ``delay_s`` is the delay that an earlier turn learned."""
    return Turn(now_s, abs(remaining_rad), params.delay_s if delay_s is None else delay_s, params.creep_rad_s)


def step(
    params: TurnParameters, turn: Turn, now_s: float, remaining_rad: float, *, stands: bool
) -> tuple[Turn, float | None]:
    """The turn and the rate to command now (rad/s, CCW positive; None when the turn is done).

    ``remaining_rad`` is the rotation still to do, as odometry shows it.

    Raises:
        ProgramError: the turn does not come to its end.
    """
    _check(params, turn, now_s, remaining_rad)
    attempt = turn.now
    if attempt.stopped_s is not None:
        if not stands or now_s - attempt.stopped_s < turn.delay_s + SETTLE_S:
            return turn, 0.0
        last_resort = LAST_RESORT if turn.tries >= params.tries else 1.0
        if abs(remaining_rad) <= last_resort * params.tolerance_rad:
            return turn, None
        turn = _learn(params, turn, remaining_rad)
        attempt = turn.now
    if attempt.way == 0:
        if stands and abs(remaining_rad) <= params.tolerance_rad:
            return turn, None
        attempt = Try(1 if remaining_rad > 0 else -1, remaining_rad, now_s)
    to_come_rad = remaining_rad - _pending_rad(attempt, now_s, turn.delay_s)
    sticks = stands and now_s - attempt.began_s > turn.delay_s + STUCK_S
    if attempt.way * to_come_rad <= 0 or sticks:
        return replace(turn, now=replace(attempt, stopped_s=now_s)), 0.0
    rate = attempt.way * _rate(params, turn, abs(to_come_rad))
    asked = (*_within(attempt.asked, now_s - turn.delay_s), (now_s, rate))
    return replace(turn, now=replace(attempt, asked=asked)), rate


def _rate(params: TurnParameters, turn: Turn, distance_rad: float) -> float:
    """The rate from which the deceleration stops within the distance, no slower than creeping."""
    slowing = math.sqrt(2 * params.deceleration_rad_s2 * distance_rad)
    return max(min(slowing, params.rate_rad_s), turn.creep_rad_s)


def _within(asked: tuple[tuple[float, float], ...], since_s: float) -> tuple[tuple[float, float], ...]:
    """The commands since then, and the one that was in force at that time."""
    first = sum(stamp_s <= since_s for stamp_s, _ in asked)
    return asked[max(first - 1, 0) :]


def _pending_rad(attempt: Try, now_s: float, delay_s: float) -> float:
    """The rotation commanded within the last ``delay_s``, which odometry does not show yet."""
    pending_rad, until_s = 0.0, now_s
    for stamp_s, rate in reversed(attempt.asked):
        pending_rad += rate * max(0.0, until_s - max(stamp_s, now_s - delay_s))
        until_s = min(until_s, stamp_s)
    return pending_rad


def _learn(params: TurnParameters, turn: Turn, remaining_rad: float) -> Turn:
    """The next try after a miss: an overshoot means that the delay was assumed too short, an undershoot too long."""
    attempt = turn.now
    beyond_rad = -attempt.way * remaining_rad
    turned_rad = abs(attempt.from_rad - remaining_rad)
    if turned_rad < STUCK_SHARE * abs(attempt.from_rad):
        creep_rad_s = min(PUSH * turn.creep_rad_s, params.rate_rad_s)
        return replace(turn, creep_rad_s=creep_rad_s, tries=turn.tries + 1, now=Try())
    slowing, creep = params.deceleration_rad_s2, turn.creep_rad_s
    late_s = (
        math.sqrt(creep**2 + 2 * slowing * abs(beyond_rad)) - creep
    ) / slowing  # at the end of the approach
    change_s = LEARNED_SHARE * math.copysign(late_s, beyond_rad)
    delay_s = min(max(turn.delay_s + change_s, 0.0), params.max_delay_s)
    return replace(turn, delay_s=delay_s, creep_rad_s=params.creep_rad_s, tries=turn.tries + 1, now=Try())


def _check(params: TurnParameters, turn: Turn, now_s: float, remaining_rad: float) -> None:
    took_s = now_s - turn.began_s
    ideal_s = turn.whole_rad / params.rate_rad_s + params.rate_rad_s / params.deceleration_rad_s2
    if turn.tries <= params.tries and took_s <= ideal_s + params.patience_s:
        return
    left, whole, most = (math.degrees(rad) for rad in (remaining_rad, turn.whole_rad, params.tolerance_rad))
    told = (
        f"the turn does not come to its end: {left:+.1f}° left of {whole:.0f}° after {took_s:.0f} s "
        f"and {min(turn.tries, params.tries)} tries (expected within {most:.1f}°); "
        "see what 'chefbotctl status' says holds the robot, and its gains"
    )
    raise ProgramError(Exit.NOT_DONE, told)
