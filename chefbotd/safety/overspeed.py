"""Detects wheels that turn much faster than asked, beyond what braking explains.

Causes are a feedforward made for another full scale, a gain that is ten times too large, or a motor driver that is
stuck. Feedback with a limited output cannot hold such a wheel. The way that a wheel rolls beyond its allowed speed is
summed up, as in a CUSUM test (Page, "Continuous Inspection Schemes", Biometrika 41, 1954). So neither the rate of the
readings nor their noise matters, and twice the excess is found in half the time. Forwards and backwards are summed
separately, so an encoder that dithers adds up to nothing.

The allowed speed is what the wheel was asked for, and a margin. After it was asked for less, the wheel may be as fast
as one that slows down by ``braking_m_s2``. A reading damaged on the line may look like a leap, and the next good one
like a leap back. Neither is enough alone, and the excess has to last.
"""

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
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
    """The allowed speed of a wheel, how far it rolled beyond that forwards and backwards, and since when."""

    asked_m_s: float = 0.0
    ahead_m: float = 0.0
    back_m: float = 0.0
    lasted_s: float = 0.0


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
    """A good reading, ``dt_s`` after the last one, in which each rim rolled ``travel_m``, asked for ``asked_m_s``.

    Wheels whose reading is not believed (``excluded``) are not judged. No wheel is judged while none is asked to move:
    that case is ``chefbotd.safety.unresponsive``.
    """
    dt_s, driven = max(dt_s, 0.0), any(asked_m_s)
    wheels = zip(state, asked_m_s, travel_m, strict=True)
    after = tuple(
        [
            _add(params, excess, abs(asked), travel, dt_s)
            if driven and i not in excluded
            else Excess(_slowed(params, excess, abs(asked), dt_s))
            for i, (excess, asked, travel) in enumerate(wheels)
        ]
    )
    too_fast = [i for i, excess in enumerate(after) if excess.lasted_s >= params.duration_s]
    return after, _explain(names, too_fast, asked_m_s, travel_m, dt_s) if too_fast else None


def _add(
    params: OverspeedParameters, excess: Excess, asked_m_s: float, travel_m: float, dt_s: float
) -> Excess:
    """Add what the wheel rolled beyond the allowed way. Rolling less takes off, down to the worth of a late reading."""
    fastest_m_s = excess.asked_m_s if excess.asked_m_s > asked_m_s else asked_m_s
    allowed_m_s = fastest_m_s * (1 + params.share) + params.margin_m_s
    allowed_m, least_m = allowed_m_s * dt_s, -allowed_m_s * params.stamp_error_s
    most_m = params.excess_m * LEAP_SHARE
    ahead_m, back_m = travel_m - allowed_m, -travel_m - allowed_m
    ahead_m = excess.ahead_m + (ahead_m if ahead_m < most_m else most_m)
    back_m = excess.back_m + (back_m if back_m < most_m else most_m)
    was_beyond = excess.ahead_m > params.excess_m or excess.back_m > params.excess_m
    is_beyond = ahead_m > params.excess_m or back_m > params.excess_m
    lasted_s = excess.lasted_s + dt_s if was_beyond and is_beyond else 0.0
    ahead_m = ahead_m if ahead_m > least_m else least_m
    back_m = back_m if back_m > least_m else least_m
    return Excess(_slowed(params, excess, asked_m_s, dt_s), ahead_m, back_m, lasted_s)


def _slowed(params: OverspeedParameters, excess: Excess, asked_m_s: float, dt_s: float) -> float:
    """How fast a braked wheel may still be that was asked for more before."""
    braked_m_s = excess.asked_m_s - params.braking_m_s2 * dt_s
    return asked_m_s if asked_m_s > braked_m_s else braked_m_s


def _explain(
    names: tuple[str, ...],
    too_fast: list[int],
    asked_m_s: tuple[float, ...],
    travel_m: tuple[float, ...],
    dt_s: float,
) -> Fault:
    worst = max(too_fast, key=lambda i: abs(travel_m[i]) - abs(asked_m_s[i]) * dt_s)
    measured = f"{travel_m[worst] / dt_s:.2f} m/s" if dt_s > 0 else "faster"
    reason = (
        f"{' and '.join(names[i] for i in too_fast)} much faster than asked "
        f"({measured} instead of {asked_m_s[worst]:.2f}): check the configured full scale of the duty, "
        "the gains, the encoder's counts per turn, and the motor's driver"
    )
    return Fault(FaultKind.OVERSPEED, reason)
