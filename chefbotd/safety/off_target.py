"""Notices wheels that turn at another speed than asked for, or than their duty can give, for seconds; it stops nothing.

A controller that cannot hold its wheels is no fault by itself, but the robot does not go where odometry says, or not as
fast as it was told. Two causes look the same to a wheel that only knows its encoder: wrong counts per turn, and a wrong
full scale of the duty. So what is said names what was measured, and asks for a wheel to be turned by hand first.

Speeds are means over the last seconds (a first-order low-pass), of readings over which one command was in force.
"""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Final

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence, join_words

MIN_SPEED_M_S: Final = 0.04
"""A rim that is asked for less is not judged: the edges of a slow encoder tell too little of its speed; assumed."""

DURATION_S: Final = 2.0
"""A rim is off its target when it has been off for so long: a start or a bump is over by then; assumed."""

FILTER_S: Final = 1.0
"""The time constant of the mean speeds; assumed."""


class OffTargetParameters(Parameters):
    """A rim that differs for seconds from the speed that it is asked for, by ``share`` of it, is off its target."""

    retired: ClassVar[Mapping[str, Any]] = {
        "least_m_s": MIN_SPEED_M_S,
        "lasts_s": DURATION_S,
        "filter_s": FILTER_S,
    }

    share: float = Field(default=0.4, gt=0, le=10)


FASTER_THAN_MOTOR = 1.3
"""A wheel that turns this many times as fast as a free motor would at its duty cannot do so."""

RESOLVED_M_S = 0.02
"""Less is no difference: the edges of a slow encoder, and how the duty changes."""

HALF_AS_FAST, HARD_SHARE = 0.6, 0.6
"""A wheel that turns less than this share of what its duty gives is slow, where the duty is this share of the range."""


class Pace(Record, frozen=True):
    """The mean speeds of a rim, measured and asked for, and its mean effort; off its target for ``lasted_s``."""

    measured_m_s: float = 0.0
    asked_m_s: float = 0.0
    effort: float = 0.0
    lasted_s: float = 0.0


def at_rest(wheels: int) -> tuple[Pace, ...]:
    """The state of this many wheels before the first reading."""
    return (Pace(),) * wheels


def watch(
    params: OffTargetParameters,
    state: tuple[Pace, ...],
    asked_m_s: tuple[float, ...],
    effort: tuple[float, ...],
    travel_m: tuple[float, ...],
    dt_s: float,
    free_m_s: float,
) -> tuple[Pace, ...]:
    """A good reading over ``dt_s``, in which the same speeds were asked for, with this effort of each wheel.

    ``free_m_s`` is the speed of a free rim at full duty.
    """
    if not dt_s > 0 or (not any(asked_m_s) and not any(pace.lasted_s for pace in state)):
        return state
    kept = math.exp(-dt_s / FILTER_S)
    wheels = zip(state, asked_m_s, effort, travel_m, strict=True)
    return tuple([_step(params, *wheel, dt_s, kept, free_m_s) for wheel in wheels])


def _step(
    params: OffTargetParameters,
    pace: Pace,
    asked_m_s: float,
    effort: float,
    travel_m: float,
    dt_s: float,
    kept: float,
    free_m_s: float,
) -> Pace:
    measured_m_s = kept * pace.measured_m_s + (1 - kept) * travel_m / dt_s
    mean_m_s = kept * pace.asked_m_s + (1 - kept) * asked_m_s
    mean_effort = kept * pace.effort + (1 - kept) * effort
    is_asked = abs(asked_m_s) >= MIN_SPEED_M_S and abs(mean_m_s) >= MIN_SPEED_M_S
    is_off = is_asked and (
        abs(measured_m_s - mean_m_s) > params.share * abs(mean_m_s)
        or _outruns(measured_m_s, mean_effort, free_m_s)
        or _lags(measured_m_s, mean_effort, free_m_s)
    )
    lasted_s = pace.lasted_s + dt_s if is_off else max(0.0, pace.lasted_s - dt_s)
    return Pace(measured_m_s, mean_m_s, mean_effort, min(lasted_s, 2 * DURATION_S))


def sentence(
    params: OffTargetParameters,
    names: tuple[str, ...],
    state: tuple[Pace, ...],
    free_m_s: float,
    counts_per_turn: float,
) -> str:
    """What is wrong, for people; empty where nothing is.

    ``free_m_s`` is the speed of a rim at full duty, ``counts_per_turn`` what is configured.
    """
    off = [i for i, pace in enumerate(state) if pace.lasted_s >= DURATION_S]
    if not off:
        return ""
    worst = max(off, key=lambda i: abs(state[i].measured_m_s - state[i].asked_m_s))
    pace = state[worst]
    who, pace_words = join_words([names[i] for i in off]), _compare_pace(pace, free_m_s)
    speeds = {"measured_m_s": abs(pace.measured_m_s), "asked_m_s": abs(pace.asked_m_s), "pace": pace_words}
    if len(off) > 1:
        return Sentence(
            "driving.wheels_off_target",
            "{wheels} turn at {measured_m_s:.2f} m/s by the encoders, where {asked_m_s:.2f} is asked for{pace}. "
            "Calibrate the encoders by hand first: "
            "the configured {counts:g} counts per turn are assumed unless somebody has done that. If they are "
            "right, see the full scale of the duty, the gains, the battery, and what holds the wheel",
            wheels=who,
            counts=counts_per_turn,
            **speeds,
        )
    return Sentence(
        "driving.wheel_off_target",
        "{wheels} turns at {measured_m_s:.2f} m/s by the encoders, where {asked_m_s:.2f} is asked for{pace}. "
        "Calibrate the encoders by hand first: "
        "the configured {counts:g} counts per turn are assumed unless somebody has done that. If they are "
        "right, see the full scale of the duty, the gains, the battery, and what holds the wheel",
        wheels=who,
        counts=counts_per_turn,
        **speeds,
    )


def _outruns(measured_m_s: float, effort: float, free_m_s: float) -> bool:
    """Whether a wheel turns faster than its motor can at this duty."""
    return abs(measured_m_s) > FASTER_THAN_MOTOR * abs(effort) * free_m_s + RESOLVED_M_S


def _lags(measured_m_s: float, effort: float, free_m_s: float) -> bool:
    """Whether a wheel that is driven hard turns about half as fast as this duty gives."""
    return abs(effort) >= HARD_SHARE and abs(measured_m_s) < HALF_AS_FAST * abs(effort) * free_m_s


def _compare_pace(pace: Pace, free_m_s: float) -> str:
    """How that compares with what the duty can give."""
    most_m_s = abs(pace.effort) * free_m_s
    if _outruns(pace.measured_m_s, pace.effort, free_m_s):
        return Sentence(
            "driving.outruns_motor",
            "; its motor can make {most_m_s:.2f} at that duty, so the counts, or the duty's scale, are wrong",
            most_m_s=most_m_s,
        )
    if _lags(pace.measured_m_s, pace.effort, free_m_s):
        return Sentence(
            "driving.lags_motor", "; at that duty a free wheel makes about {most_m_s:.2f}", most_m_s=most_m_s
        )
    return ""
