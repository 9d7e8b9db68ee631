"""Detects a robot that moves although it is told to stand, because its board ignores commands.

Zero is sent again after every reading. A board that has sent a few readings since the first zero has had time to obey.
From then on a wheel may roll as far as one that slows down by ``braking_m_s2``. A wheel that rolls further is still
driven.

A robot that has come to rest may be pushed by somebody, so rolling then proves nothing. Only the board's own echo
counts then: where the echo is known to follow the commands, it must not show a driven motor after zero was sent. So a
robot that is pushed by hand is no fault, armed or not. A robot that never stopped is a fault in every mode, and only
the motors' power switch stops it.
"""

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence
from chefbotd.safety.faults import Fault, FaultKind


class UnresponsiveParameters(Parameters):
    """When a wheel that turns is no longer coasting.

    The board has heard a stop after ``reaction_s`` and ``readings`` of its own. From then on the wheels slow down by
    ``braking_m_s2``, and more than ``tolerance_m`` beyond that way is too far. A robot slower than ``rest_m_s`` for
    ``rest_s`` has come to rest.
    """

    reaction_s: float = Field(default=0.25, gt=0, le=10)
    readings: int = Field(default=3, ge=2, le=1000)
    braking_m_s2: float = Field(default=0.5, gt=0, le=100)
    tolerance_m: float = Field(default=0.03, gt=0, le=1)
    rest_m_s: float = Field(default=0.005, gt=0, le=1)
    rest_s: float = Field(default=0.2, gt=0, le=10)


class UnresponsiveState(Record, frozen=True):
    """What has been seen since the last duty: ``told_s`` is when zero was first sent (None: a duty is in force).

    Since then ``readings`` have come. The wheels may roll ``coasting_m`` (None: the board need not have obeyed yet)
    and have rolled ``moved_m``, forwards less backwards. They have been slow for ``slow_s``; ``rested`` says whether
    that was once long enough. ``beyond`` readings, less those that did not, showed
    too long a way.
    """

    told_s: float | None = None
    readings: int = 0
    coasting_m: float | None = None
    moved_m: tuple[float, ...] = ()
    slow_s: float = 0.0
    rested: bool = False
    beyond: int = 0


DRIVEN = UnresponsiveState()
"""A duty is in force, or nothing was said yet."""


def record_command(state: UnresponsiveState, now_s: float, *, driven: bool) -> UnresponsiveState:
    """A command goes to the board; ``driven`` says whether it is other than zero."""
    if driven:
        return DRIVEN
    return UnresponsiveState(told_s=now_s) if state.told_s is None else state


def watch(
    params: UnresponsiveParameters,
    state: UnresponsiveState,
    taken_s: float,
    travel_m: tuple[float, ...],
    speed_m_s: tuple[float, ...],
    dt_s: float,
    *,
    echoes_motion: bool,
) -> tuple[UnresponsiveState, Fault | None]:
    """A good reading, taken at ``taken_s``, ``dt_s`` after the last one; ``speed_m_s`` are the rims' mean speeds lately.

    One that was taken before zero was sent, and waited on the line, says nothing.

    ``echoes_motion``: the board, whose echo follows its commands, says that a motor is driven. A fault is told once
    until the next command that is not zero.
    """
    if state.told_s is None or taken_s <= state.told_s:
        return state, None
    waited_s = taken_s - state.told_s
    fastest_m_s, readings = max(map(abs, speed_m_s)), state.readings + 1
    slow_s = state.slow_s + max(dt_s, 0.0) if fastest_m_s < params.rest_m_s else 0.0
    state = replace(state, readings=readings, slow_s=slow_s)
    if slow_s >= params.rest_s and not echoes_motion:
        return replace(state, rested=True, coasting_m=0.0, moved_m=(0.0,) * len(travel_m), beyond=0), None
    if state.coasting_m is None:
        heard = readings >= params.readings and waited_s >= params.reaction_s
        coasting_m = fastest_m_s**2 / (2 * params.braking_m_s2)
        return (
            replace(state, coasting_m=coasting_m, moved_m=(0.0,) * len(travel_m)) if heard else state
        ), None
    moved_m = tuple([moved + travel for moved, travel in zip(state.moved_m, travel_m, strict=True)])
    too_far = max(map(abs, moved_m)) > state.coasting_m + params.tolerance_m
    is_beyond = too_far and (echoes_motion or not state.rested)
    beyond = state.beyond + 1 if is_beyond else state.beyond
    if not is_beyond and 0 < beyond < CONFIRMED:
        beyond -= 1
    fault = _explain(waited_s, fastest_m_s, echoes_motion) if is_beyond and beyond == CONFIRMED else None
    return replace(state, moved_m=moved_m, beyond=beyond), fault


CONFIRMED = 3
"""So many readings, less those that say otherwise: a damaged one can look like a way, and a damaged echo like a motor
that is driven."""


def _explain(told_s: float, fastest_m_s: float, echoes_motion: bool) -> Fault:
    if echoes_motion:
        reason = Sentence(
            "driving.unresponsive_and_echoes",
            "the board ignores commands: the wheels turn at {fastest_m_s:.2f} m/s, {told_s:.1f} s after they were told "
            "to stand, and its echo shows a duty other than zero. Cut the motors' power; then check the board, its "
            "cable and the motors' driver",
            fastest_m_s=fastest_m_s,
            told_s=told_s,
        )
    else:
        reason = Sentence(
            "driving.unresponsive",
            "the board ignores commands: the wheels turn at {fastest_m_s:.2f} m/s, {told_s:.1f} s after they were told "
            "to stand. Cut the motors' power; then check the board, its cable and the motors' driver",
            fastest_m_s=fastest_m_s,
            told_s=told_s,
        )
    return Fault(FaultKind.BOARD_UNRESPONSIVE, reason)
