"""Turns in place to a heading, although odometry shows a command only after a delay.

A Smith predictor, whose model is the command itself, adds the rotation that was commanded and is not visible yet. The
robot is therefore told to stop before odometry shows the goal. The delay differs between boards by several times, so it
is learned: each stop that misses the goal corrects it. The robot stands still between two tries. If it did not move,
the next try is faster.
"""

import math

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.core.record import Record, replace

RATE_RAD_S, DECELERATION_RAD_S2, CREEP_RAD_S = 1.2, 1.0, 0.15
"""How fast the robot turns, how it slows down, and how slowly it approaches the goal."""

TOLERANCE_RAD = 0.008
"""The turn is done when the robot stands so near to the goal."""

FIRST_DELAY_S, MAX_DELAY_S = 0.2, 1.0
"""The delay that a first turn assumes, and the longest that is learned."""

TRIES = 12
PATIENCE_S = 15.0
"""A turn fails so long after the time that one without a fault takes."""


class Try(Record, frozen=True):
    """One approach: to the left (1) or the right (-1; 0: not yet begun), from where, and since when.

    ``asked`` is what was asked of late, oldest first: since when, and the rate. ``stopped_s`` is when it was told to
    stop.
    """

    direction: int = 0
    from_rad: float = 0.0
    began_s: float = 0.0
    asked: tuple[tuple[float, float], ...] = ()
    stopped_s: float | None = None


class TurnInPlace(Record, frozen=True):
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


def begin(now_s: float, remaining_rad: float, delay_s: float = FIRST_DELAY_S) -> TurnInPlace:
    """A turn of ``remaining_rad`` (CCW positive). ``delay_s`` is the delay that an earlier turn learned."""
    return TurnInPlace(now_s, abs(remaining_rad), delay_s, CREEP_RAD_S)


def step(
    turn: TurnInPlace, now_s: float, remaining_rad: float, *, stands: bool
) -> tuple[TurnInPlace, float | None]:
    """The turn and the rate to command now (rad/s, CCW positive; None when the turn is done).

    ``remaining_rad`` is the rotation still to do, as odometry shows it.

    Raises:
        ProgramError: the turn does not come to its end.
    """
    _check(turn, now_s, remaining_rad)
    attempt = turn.now
    if attempt.stopped_s is not None:
        if not stands or now_s - attempt.stopped_s < turn.delay_s + SETTLE_S:
            return turn, 0.0
        last_resort = LAST_RESORT if turn.tries >= TRIES else 1.0
        if abs(remaining_rad) <= last_resort * TOLERANCE_RAD:
            return turn, None
        turn = _learn(turn, remaining_rad)
        attempt = turn.now
    if attempt.direction == 0:
        if stands and abs(remaining_rad) <= TOLERANCE_RAD:
            return turn, None
        attempt = Try(1 if remaining_rad > 0 else -1, remaining_rad, now_s)
    to_come_rad = remaining_rad - _pending_rad(attempt, now_s, turn.delay_s)
    sticks = stands and now_s - attempt.began_s > turn.delay_s + STUCK_S
    if attempt.direction * to_come_rad <= 0 or sticks:
        return replace(turn, now=replace(attempt, stopped_s=now_s)), 0.0
    rate = attempt.direction * _rate(turn, abs(to_come_rad))
    asked = (*_within(attempt.asked, now_s - turn.delay_s), (now_s, rate))
    return replace(turn, now=replace(attempt, asked=asked)), rate


def _rate(turn: TurnInPlace, distance_rad: float) -> float:
    """The rate from which the deceleration stops within the distance, no slower than creeping."""
    slowing = math.sqrt(2 * DECELERATION_RAD_S2 * distance_rad)
    return max(min(slowing, RATE_RAD_S), turn.creep_rad_s)


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


def _learn(turn: TurnInPlace, remaining_rad: float) -> TurnInPlace:
    """The next try after a miss: an overshoot means that the delay was assumed too short, an undershoot too long."""
    attempt = turn.now
    beyond_rad = -attempt.direction * remaining_rad
    turned_rad = abs(attempt.from_rad - remaining_rad)
    if turned_rad < STUCK_SHARE * abs(attempt.from_rad):
        creep_rad_s = min(PUSH * turn.creep_rad_s, RATE_RAD_S)
        return replace(turn, creep_rad_s=creep_rad_s, tries=turn.tries + 1, now=Try())
    slowing, creep = DECELERATION_RAD_S2, turn.creep_rad_s
    late_s = (
        math.sqrt(creep**2 + 2 * slowing * abs(beyond_rad)) - creep
    ) / slowing  # at the end of the approach
    change_s = LEARNED_SHARE * math.copysign(late_s, beyond_rad)
    delay_s = min(max(turn.delay_s + change_s, 0.0), MAX_DELAY_S)
    return replace(turn, delay_s=delay_s, creep_rad_s=CREEP_RAD_S, tries=turn.tries + 1, now=Try())


def _check(turn: TurnInPlace, now_s: float, remaining_rad: float) -> None:
    took_s = now_s - turn.began_s
    ideal_s = turn.whole_rad / RATE_RAD_S + RATE_RAD_S / DECELERATION_RAD_S2
    if turn.tries <= TRIES and took_s <= ideal_s + PATIENCE_S:
        return
    left, whole, most = (math.degrees(rad) for rad in (remaining_rad, turn.whole_rad, TOLERANCE_RAD))
    reason = (
        f"the turn does not come to its end: {left:+.1f}° left of {whole:.0f}° after {took_s:.0f} s "
        f"and {min(turn.tries, TRIES)} tries (expected within {most:.1f}°); "
        "see what 'chefbotctl status' says holds the robot, and its gains"
    )
    raise ProgramError(Exit.NOT_DONE, reason)
