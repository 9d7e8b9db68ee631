"""Detects wheels that turn much faster than asked, beyond what braking explains.

Causes are a feedforward made for another full scale, a gain that is ten times too large, or a motor driver that is
stuck. Feedback with a limited output cannot hold such a wheel. The way that a wheel rolls beyond its allowed speed is
summed up, as in a CUSUM test (Page, "Continuous Inspection Schemes", Biometrika 41, 1954). So neither the rate of the
readings nor their noise matters, and twice the excess is found in half the time. Forwards and backwards are summed
separately, so an encoder that dithers adds up to nothing.

The allowed speed is the fastest that a command which can have been in force asked for (``in_force``), and a margin.
After that command the wheel may be as fast as one that slows down by ``braking_m_s2``. A reading damaged on the line may
look like a leap, and the next good one like a leap back. Neither is enough alone, and the excess has to last. One
reading that is no excess takes off its own time, and no more.
"""

import math

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence, join_words
from chefbotd.safety.faults import Fault, FaultKind


class OverspeedParameters(Parameters):
    """A rim may be faster than asked by ``share`` of it and ``margin_m_s``.

    Beyond that it is a fault once it has rolled ``excess_m`` too far and ``duration_s`` more have passed. A braked wheel
    slows down by ``braking_m_s2`` at least. A reading's stamp may be wrong by ``stamp_error_s``.
    """

    share: float = Field(default=0.15, ge=0, le=5)
    margin_m_s: float = Field(default=0.04, gt=0, le=5)
    braking_m_s2: float = Field(default=0.75, gt=0, le=100)
    excess_m: float = Field(default=0.015, gt=0, le=1)
    duration_s: float = Field(default=0.1, gt=0, le=5)
    stamp_error_s: float = Field(default=0.05, ge=0, le=1)


LEAP_SHARE = 0.8
"""No reading adds more than this share of what is too much."""


class Excess(Record, frozen=True):
    """The allowed speed of a wheel, how far it rolled beyond that forwards and backwards, and since when.

    Of the readings that speak against it, the worst one showed ``measured_m_s`` where ``allowed_m_s`` was allowed, and
    the fastest command in force asked for ``worst_asked_m_s``.
    """

    asked_m_s: float = 0.0
    ahead_m: float = 0.0
    back_m: float = 0.0
    lasted_s: float = 0.0
    measured_m_s: float = 0.0
    allowed_m_s: float = 0.0
    worst_asked_m_s: float = 0.0


OverspeedState = tuple[Excess, ...]


def at_rest(wheels: int) -> OverspeedState:
    """The state of this many wheels before the first reading."""
    return (Excess(),) * wheels


def watch(
    params: OverspeedParameters,
    names: tuple[str, ...],
    state: OverspeedState,
    asked_m_s: tuple[float, ...],
    travel_m: tuple[float, ...],
    dt_s: float,
    excluded: tuple[int, ...] = (),
) -> tuple[OverspeedState, Fault | None]:
    """A good reading, ``dt_s`` after the last one, in which each rim rolled ``travel_m``.

    ``asked_m_s`` is the fastest that each was asked for by a command that can have been in force meanwhile. Wheels whose
    reading is not believed (``excluded``) are not judged. No wheel is judged while none is asked to move: that case is
    ``chefbotd.safety.unresponsive``.
    """
    dt_s, driven = max(dt_s, 0.0), any(asked_m_s)
    wheels = zip(state, asked_m_s, travel_m, strict=True)
    after = tuple(
        [
            _add(params, excess, asked, travel, dt_s)
            if driven and i not in excluded
            else Excess(_brake_bound(params, excess, abs(asked), dt_s))
            for i, (excess, asked, travel) in enumerate(wheels)
        ]
    )
    too_fast = [i for i, excess in enumerate(after) if excess.lasted_s >= params.duration_s]
    return after, _explain(names, too_fast, after) if too_fast else None


def _add(
    params: OverspeedParameters, excess: Excess, signed_m_s: float, travel_m: float, dt_s: float
) -> Excess:
    """Add what the wheel rolled beyond the allowed way. Rolling less takes off, down to the worth of a late reading."""
    asked_m_s = signed_m_s if signed_m_s > 0 else -signed_m_s
    fastest_m_s = excess.asked_m_s if excess.asked_m_s > asked_m_s else asked_m_s
    allowed_m_s = fastest_m_s * (1 + params.share) + params.margin_m_s
    allowed_m, least_m = allowed_m_s * dt_s, -allowed_m_s * params.stamp_error_s
    most_m = params.excess_m * LEAP_SHARE
    ahead_m, back_m = travel_m - allowed_m, -travel_m - allowed_m
    ahead_m = excess.ahead_m + (ahead_m if ahead_m < most_m else most_m)
    back_m = excess.back_m + (back_m if back_m < most_m else most_m)
    was_beyond = excess.ahead_m > params.excess_m or excess.back_m > params.excess_m
    is_beyond = ahead_m > params.excess_m or back_m > params.excess_m
    lasted_s = excess.lasted_s
    if was_beyond and is_beyond:
        lasted_s += dt_s
    elif lasted_s:
        lasted_s = lasted_s - dt_s if lasted_s > dt_s else 0.0
    ahead_m = ahead_m if ahead_m > least_m else least_m
    back_m = back_m if back_m > least_m else least_m
    asked_next_m_s = _brake_bound(params, excess, asked_m_s, dt_s)
    if ahead_m <= 0 and back_m <= 0 and not lasted_s:
        return Excess(asked_next_m_s, ahead_m, back_m)
    worst = excess.measured_m_s, excess.allowed_m_s, excess.worst_asked_m_s
    if dt_s > 0 and abs(travel_m) / dt_s - allowed_m_s > abs(worst[0]) - worst[1]:
        worst = travel_m / dt_s, allowed_m_s, math.copysign(fastest_m_s, signed_m_s)
    return Excess(asked_next_m_s, ahead_m, back_m, lasted_s, *worst)


def _brake_bound(params: OverspeedParameters, excess: Excess, asked_m_s: float, dt_s: float) -> float:
    """How fast a braked wheel may still be that was asked for more before."""
    braked_m_s = excess.asked_m_s - params.braking_m_s2 * dt_s
    return asked_m_s if asked_m_s > braked_m_s else braked_m_s


def _explain(names: tuple[str, ...], too_fast: list[int], state: OverspeedState) -> Fault:
    """The reading that speaks most against the worst of these wheels, and what it was held against."""
    worst = max(
        [state[i] for i in too_fast], key=lambda excess: abs(excess.measured_m_s) - excess.allowed_m_s
    )
    reason = Sentence(
        "driving.overspeed",
        "{wheels} much faster than asked ({measured_m_s:.2f} m/s instead of {asked_m_s:.2f}), "
        "where {allowed_m_s:.2f} m/s were allowed: check the configured full scale of the duty, "
        "the gains, the encoder's counts per turn, and the motor's driver",
        wheels=join_words([names[i] for i in too_fast]),
        measured_m_s=worst.measured_m_s,
        asked_m_s=worst.worst_asked_m_s,
        allowed_m_s=worst.allowed_m_s,
    )
    return Fault(FaultKind.OVERSPEED, reason)
