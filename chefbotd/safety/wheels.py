"""Wheels that do not do what their motors are told: stalled, turning the wrong way, or with an encoder that jumps.

A wheel that is driven hard enough to turn must turn, and the right way round. How far it went since it has been pushed
one way is all that is looked at, so neither the rate of the readings nor a velocity filter matters.
"""

from dataclasses import dataclass
from typing import NamedTuple

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.safety.faults import Fault, FaultKind


class WheelWatchParameters(Parameters):
    """When to believe that something is wrong.

    A wheel counts as driven above ``driven_duty_share`` of its duty range. It is stalled when it was driven one way for
    ``stalled_s`` and turned less than ``turned_rad``; it is reversed when it turned ``reversed_rad`` the other way. A
    refused reading counts one against its wheel, a good one takes off ``forgiven_per_reading``; ``jumps`` are too many.
    So isolated damage on the line passes, at any rate of readings, while up to a fifth of them is refused.
    """

    driven_duty_share: float = Field(default=0.2, gt=0, le=1)
    stalled_s: float = Field(default=1.75, gt=0, le=60)
    turned_rad: float = Field(default=0.1, gt=0, le=100)
    reversed_rad: float = Field(default=1.0, gt=0, le=100)
    jumps: float = Field(default=10.0, ge=1, le=1000)
    forgiven_per_reading: float = Field(default=0.25, gt=0, le=1)


class Push(NamedTuple):
    """A wheel pushed one way (``direction`` 1 or -1, 0: not driven): for how long, and how far it went that way."""

    direction: int = 0
    pushed_s: float = 0.0
    turned_rad: float = 0.0


NOT_DRIVEN = Push()


@dataclass(frozen=True, slots=True)
class WheelWatchState:
    """A push and a count of jumps per wheel."""

    pushes: tuple[Push, ...]
    jumps: tuple[float, ...]


def at_rest(wheels: int) -> WheelWatchState:
    """So many wheels of which nothing is known."""
    return WheelWatchState((NOT_DRIVEN,) * wheels, (0.0,) * wheels)


def watch(
    params: WheelWatchParameters,
    names: tuple[str, ...],
    state: WheelWatchState,
    effort: tuple[float, ...],
    travel_rad: tuple[float, ...],
    dt_s: float,
) -> tuple[WheelWatchState, Fault | None]:
    """A good reading, ``dt_s`` after the last one.

    ``effort`` is the duty that was in force since, as a share of the range, and ``travel_rad`` what came of it: both
    positive when the wheel rolls forward.
    """
    wheels = zip(state.pushes, effort, travel_rad, strict=True)
    pushes = tuple([_push(params, *wheel, dt_s) for wheel in wheels])
    jumps = state.jumps
    if any(jumps):
        jumps = tuple([max(0.0, count - params.forgiven_per_reading) for count in jumps])
    return WheelWatchState(pushes, jumps), _first_fault(params, names, pushes)


def note_jump(
    params: WheelWatchParameters, names: tuple[str, ...], state: WheelWatchState, jumped: tuple[int, ...]
) -> tuple[WheelWatchState, Fault | None]:
    """A reading was refused because the wheels with these indices cannot have turned that far."""
    jumps = tuple([count + (i in jumped) for i, count in enumerate(state.jumps)])
    bad = [name for name, count in zip(names, jumps, strict=True) if count >= params.jumps]
    counted = WheelWatchState(state.pushes, jumps)
    return counted, _explain(FaultKind.ENCODER_JUMPS, " and ".join(bad)) if bad else None


def _push(params: WheelWatchParameters, push: Push, effort: float, travel_rad: float, dt_s: float) -> Push:
    """The push goes on while its direction stays; a wheel that has turned enough is above suspicion again."""
    if abs(effort) < params.driven_duty_share:
        return NOT_DRIVEN
    direction = 1 if effort > 0 else -1
    if direction != push.direction:
        return Push(direction)
    turned_rad = push.turned_rad + direction * travel_rad
    if turned_rad >= params.turned_rad:
        return Push(direction)
    return Push(direction, push.pushed_s + dt_s, turned_rad)


def _first_fault(
    params: WheelWatchParameters, names: tuple[str, ...], pushes: tuple[Push, ...]
) -> Fault | None:
    for name, (_, pushed_s, turned_rad) in zip(names, pushes, strict=True):
        if turned_rad <= -params.reversed_rad:
            return _explain(FaultKind.WHEEL_REVERSED, name)
        if pushed_s >= params.stalled_s:
            return _explain(FaultKind.WHEEL_STALLED, name)
    return None


_WORDS = {
    FaultKind.ENCODER_JUMPS: (
        "{} has an encoder whose counts jump further than a wheel can turn: "
        "check its cable and connector for a loose contact, and the configured encoders.counts_per_turn"
    ),
    FaultKind.WHEEL_STALLED: (
        "{} is driven and does not turn: check whether it is blocked, "
        "whether its motor has power and its encoder is plugged in"
    ),
    FaultKind.WHEEL_REVERSED: (
        "{} turns the wrong way: check whether its motor or its encoder is wired backwards "
        "(motor_sign, encoder_sign), or swapped with another wheel's"
    ),
}


def _explain(kind: FaultKind, wheels: str) -> Fault:
    return Fault(kind, _WORDS[kind].format(wheels))
