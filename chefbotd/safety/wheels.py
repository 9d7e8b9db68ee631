"""Detects wheels that do not follow their motors: stalled, reversed, or with an encoder that jumps.

A wheel that is driven hard enough to turn must turn, and in the right direction. The check uses only how long a wheel
was driven and how far it went, so neither the rate of the readings nor a velocity filter matters. Neither sum is
forgotten when the direction changes. So a wheel that is blocked, or whose encoder is dead, is found after the same
time of driving, however often the driver changes direction. A push is the time between two changes of direction. Only
real travel clears a wheel:

- travel in the direction of the push. A healthy wheel that is rocked moves in that direction with every push, be it by
  little;
- travel while it rolls on after a change of direction: the push before caused it, so the wheel does turn;
- travel in any direction while it is not driven: it is neither blocked nor is its encoder dead.

Travel within a play of three counts does not count (hysteresis: only what drags the ends of the play along counts). So
an encoder that dithers by a count clears no wheel, however often the direction changes. Travel in the wrong direction
is subtracted from that in the right one, so a larger dither under a steady push clears no wheel either. Nor does a
reading that the next one takes back: it was damaged on the line.

Reversed is the mirror of stalled: travel against the pushes, less travel with them, summed over pushes. A wheel that
still rolls on from the push before is excused for ``coast_s``, until it stands or turns round. A single reading may be
wrong, and the next one then goes back as far: none is more than a part of what reverses a wheel.
"""

import math

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence, join_words
from chefbotd.safety.faults import Fault, FaultKind


class WheelWatchParameters(Parameters):
    """When to believe that something is wrong.

    A wheel counts as driven above ``driven_duty_share`` of its duty range. It is stalled when it was driven for
    ``stalled_s`` and turned less than ``turned_rad``; above half of the range time counts with the square of the duty,
    as a motor that stands heats up. It is reversed when it turned ``reversed_rad`` the wrong way. In a pause suspicion
    fades: ``decay_s`` of it takes all away. After a change of direction a wheel may roll on for ``coast_s``. A
    refused reading counts one against its wheel, a good one takes off ``decay_per_reading``; ``jumps`` are too many.
    So isolated damage on the line passes, at any rate of readings, while up to a fifth of them is refused.
    """

    driven_duty_share: float = Field(default=0.2, gt=0, le=0.5)
    stalled_s: float = Field(default=1.75, gt=0, le=60)
    turned_rad: float = Field(default=0.1, gt=0, le=100)
    reversed_rad: float = Field(default=1.0, gt=0, le=100)
    coast_s: float = Field(default=0.5, ge=0, le=60)
    decay_s: float = Field(default=30.0, gt=0, le=3600)
    jumps: float = Field(default=10.0, ge=1, le=1000)
    decay_per_reading: float = Field(default=0.25, gt=0, le=1)


FULL_WEIGHT_SHARE = 0.5
"""Of the duty range: from here on driving weighs more than its time, at full duty four times as much."""

LEAP_SHARE, LEAP_S = 1 / 3, 0.25
"""A reading adds no more than this share of what is too much, or its time's share of this duration if that is more."""

PLAY_COUNTS = 3
"""One more than a position lies apart that dithers by a count to either side."""


class PushedWheel(Record, frozen=True):
    """What is held against a wheel since it last did as it was told.

    ``direction`` is that of the latest push, however gentle (1 or -1; 0 before the first). The wheel was driven for
    ``pushed_s`` and turned by ``turned_rad``; it went ``against_rad`` more against its pushes than with them. For
    ``coast_s`` it may yet roll on as before the latest push. ``play_rad`` is where in its play it is. The last reading
    cleared it of ``cleared_s``.
    """

    direction: int = 0
    pushed_s: float = 0.0
    turned_rad: float = 0.0
    against_rad: float = 0.0
    coast_s: float = 0.0
    play_rad: float = 0.0
    cleared_s: float = 0.0


class WheelWatchState(Record, frozen=True):
    """A push and a count of jumps per wheel."""

    pushes: tuple[PushedWheel, ...]
    jumps: tuple[float, ...]


def at_rest(wheels: int) -> WheelWatchState:
    """The state of this many wheels before the first reading."""
    return WheelWatchState((PushedWheel(),) * wheels, (0.0,) * wheels)


def play_of(counts_per_turn: float) -> float:
    """The play to allow an encoder of this resolution, from end to end, in radians."""
    return PLAY_COUNTS * math.tau / counts_per_turn


def watch(
    params: WheelWatchParameters,
    names: tuple[str, ...],
    state: WheelWatchState,
    effort: tuple[float, ...],
    travel_rad: tuple[float, ...],
    dt_s: float,
    play_rad: float,
    may_turn_round: tuple[bool, ...] = (),
) -> tuple[WheelWatchState, Fault | None]:
    """A good reading, ``dt_s`` after the last one.

    ``effort`` is the least duty that can have been in force since, as a share of the range, and ``travel_rad`` what came
    of it: both positive when the wheel rolls forward. ``play_rad`` is the play to allow its encoders. A wheel that
    ``may_turn_round`` can have been driven either way (empty: none of them): whichever way it went, it was as it should.
    """
    either_way = may_turn_round or (False,) * len(effort)
    wheels = zip(state.pushes, effort, travel_rad, either_way, strict=True)
    pushes = tuple([_push(params, *wheel, dt_s, play_rad / 2) for wheel in wheels])
    jumps = state.jumps
    if any(jumps):
        jumps = tuple([max(0.0, count - params.decay_per_reading) for count in jumps])
    return WheelWatchState(pushes, jumps), _first_fault(params, names, pushes, effort)


def note_jump(
    params: WheelWatchParameters,
    names: tuple[str, ...],
    state: WheelWatchState,
    jumped: tuple[int, ...],
    missing: tuple[str, ...] = (),
) -> tuple[WheelWatchState, Fault | None]:
    """A reading was refused because the wheels with these indices cannot have turned that far.

    ``missing`` names the lines that this board does not send: without its time, a line that waited looks like a jump.
    """
    jumps = tuple([count + (i in jumped) for i, count in enumerate(state.jumps)])
    bad = [name for name, count in zip(names, jumps, strict=True) if count >= params.jumps]
    counted = WheelWatchState(state.pushes, jumps)
    if not bad:
        return counted, None
    who = join_words(bad)
    if not missing:
        return counted, _explain(FaultKind.ENCODER_JUMPS, who)
    return counted, _explain_jumps_without(who, missing)


def _push(
    params: WheelWatchParameters,
    push: PushedWheel,
    effort: float,
    travel_rad: float,
    turns_round: bool,
    dt_s: float,
    half_play_rad: float,
) -> PushedWheel:
    """The push after a reading: what the wheel moved, and whether it rolled on or was driven to it."""
    reached_rad = push.play_rad + travel_rad
    play_rad = reached_rad
    if not -half_play_rad <= reached_rad <= half_play_rad:
        play_rad = half_play_rad if reached_rad > 0 else -half_play_rad
    moved_rad = reached_rad - play_rad
    direction = 1 if effort > 0 else -1 if effort < 0 else push.direction
    coast_s = push.coast_s
    if direction != push.direction:
        coast_s = params.coast_s if push.direction else 0.0
    ahead_rad = direction * moved_rad
    rolls_on = turns_round or ahead_rad < 0 < coast_s
    if not turns_round:
        coast_s = coast_s - dt_s if rolls_on else 0.0
    pushed_s, against_rad = _charge(params, push, effort, 0.0 if rolls_on else ahead_rad, dt_s)
    if rolls_on or -params.driven_duty_share < effort < params.driven_duty_share:  # any way clears it
        turned_rad = push.turned_rad + (moved_rad if moved_rad > 0 else -moved_rad)
    else:
        turned_rad = push.turned_rad + ahead_rad
        if push.cleared_s and ahead_rad <= -params.turned_rad:
            pushed_s += push.cleared_s
    cleared_s = 0.0
    if pushed_s == 0.0 or turned_rad >= params.turned_rad:
        cleared_s = pushed_s
        pushed_s = turned_rad = 0.0
    elif turned_rad < 0:
        turned_rad = 0.0
    return PushedWheel(direction, pushed_s, turned_rad, against_rad, coast_s, play_rad, cleared_s)


def _charge(
    params: WheelWatchParameters, push: PushedWheel, effort: float, ahead_rad: float, dt_s: float
) -> tuple[float, float]:
    """Add the time that the wheel was driven for and the way that it went wrong; a pause reduces both."""
    if not -params.driven_duty_share < effort < params.driven_duty_share:
        weight = (effort / FULL_WEIGHT_SHARE) ** 2
        if ahead_rad < 0:
            ahead_rad = max(ahead_rad, -params.reversed_rad * max(LEAP_SHARE, dt_s / LEAP_S))
        against_rad = push.against_rad - ahead_rad
        pushed_s = push.pushed_s + (weight if weight > 1.0 else 1.0) * dt_s
        return pushed_s, against_rad if against_rad > 0 else 0.0
    share = dt_s / params.decay_s
    pushed_s = max(0.0, push.pushed_s - share * params.stalled_s)
    return pushed_s, max(0.0, push.against_rad - share * params.reversed_rad)


def _first_fault(
    params: WheelWatchParameters,
    names: tuple[str, ...],
    pushes: tuple[PushedWheel, ...],
    effort: tuple[float, ...],
) -> Fault | None:
    """The first fault among the wheels that are driven. A wheel that is not driven was judged when it was."""
    for name, push, share in zip(names, pushes, effort, strict=True):
        if -params.driven_duty_share < share < params.driven_duty_share:
            continue
        if push.against_rad >= params.reversed_rad:
            return _explain(FaultKind.WHEEL_REVERSED, name)
        if push.pushed_s >= params.stalled_s:
            return _explain(FaultKind.WHEEL_STALLED, name)
    return None


def _explain_jumps_without(wheels: str, missing: tuple[str, ...]) -> Fault:
    """The fault where the board does not send what would tell a jump from a line that waited."""
    reason = Sentence(
        "driving.encoder_jumps_without",
        "{wheels} has an encoder whose counts jump further than a wheel can turn, and the board sends no {missing}: a "
        "line that waited on its way looks like a jump then. Give the board a sketch that sends them first; if the "
        "counts still jump, check the configured counts per turn, and the encoder's cable and connector for a loose "
        "contact",
        wheels=wheels,
        missing=" and no ".join(missing),
    )
    return Fault(FaultKind.ENCODER_JUMPS, reason)


def _explain(kind: FaultKind, wheels: str) -> Fault:
    if kind is FaultKind.ENCODER_JUMPS:
        reason = Sentence(
            "driving.encoder_jumps",
            "{wheels} has an encoder whose counts jump further than a wheel can turn: "
            "check its cable and connector for a loose contact, and the configured counts per turn",
            wheels=wheels,
        )
    elif kind is FaultKind.WHEEL_STALLED:
        reason = Sentence(
            "driving.wheel_stalled",
            "{wheels} is driven and does not turn: check whether it is blocked, "
            "whether its motor has power and its encoder is plugged in",
            wheels=wheels,
        )
    else:
        reason = Sentence(
            "driving.wheel_reversed",
            "{wheels} turns the wrong way: check whether its motor or its encoder is wired backwards, "
            "or swapped with another wheel's",
            wheels=wheels,
        )
    return Fault(kind, reason)
