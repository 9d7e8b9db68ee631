"""Detects silent encoders. The robot is not driven while its motion is unknown.

Silence stops the robot and is not a fault yet. The classic sketch regularly says nothing for up to a second while it
waits for an ultrasonic echo. A latch that trips on a healthy robot teaches people to ignore it. So the robot brakes,
and starts from rest with the next reading if it is still commanded. A silence that is longer than the sketch can
explain, and that began while the robot was driven, is a fault.

Where nothing is in reach of its ultrasonic sensor the sketch is silent for a second in every cycle, and would never be
told to move. A board that has just said after such a silence that no echo came will be silent again. Then the robot may
crawl, without a reading too: what it is told takes effect up to two cycles later. Where echoes come and go, a board that
waited for one lately may wait again: its next silence slows the robot to that crawl, and does not stop it.

One reading does not end a silence that is a fault. Silences that no echo explains are added up, and fade while readings
come.
"""

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence
from chefbotd.safety.faults import Fault, FaultKind


class EncoderTimeoutParameters(Parameters):
    """How long the encoders may be silent.

    The robot moves only if the last encoder reading is younger than ``max_age_s``. A silence of ``latch_after_s`` that
    began while the robot was driven is a fault. While the board waits for echoes that do not come, no rim moves faster
    than ``silent_speed_m_s`` (0: the robot stands).
    """

    max_age_s: float = Field(default=0.25, gt=0, le=2)
    latch_after_s: float = Field(default=2.0, ge=2, le=60)
    silent_speed_m_s: float = Field(default=0.06, ge=0, le=1)


WAIT_S = 1.3
"""A silence that is longer is not the wait for an echo: a second, a cycle, and the line."""

OBEYS_AFTER_S = 2.1
"""A command that comes just after a cycle has begun is read a cycle later, and in force after that cycle's wait."""

LATELY_S = 30.0
"""So long after an echo was missed, a silence may be the wait for another one."""

FADE_SHARE = 0.25
"""Of the time in which readings come: so much of earlier silences is forgotten."""

OVERSHOOT = 4 / 3
"""With one reading in a cycle the wheel loop goes so much faster than asked before it settles."""


class EncoderTimeoutState(Record, frozen=True):
    """When the encoders were last heard, and whether the robot was being driven when they fell silent.

    ``awaits_echo``: before that the board was silent until it said that no echo came. ``silent_s`` is how long the
    silence lasted that the last reading ended: a port that hands over several lines at once may bring that one first.
    An echo was missed last at ``missed_s``. Silences while the robot was driven that no echo explains come to
    ``unexplained_s``.
    """

    heard_s: float = float("-inf")
    interrupted: bool = False
    awaits_echo: bool = False
    silent_s: float = 0.0
    missed_s: float = float("-inf")
    unexplained_s: float = 0.0


def is_stale(params: EncoderTimeoutParameters, state: EncoderTimeoutState, now_s: float) -> bool:
    """Whether the robot must stand still because there is no recent reading."""
    return now_s - state.heard_s > params.max_age_s


def note_reading(state: EncoderTimeoutState, now_s: float) -> EncoderTimeoutState:
    """An encoder reading has come."""
    silent_s, unexplained_s = now_s - state.heard_s, state.unexplained_s
    if state.interrupted and silent_s > WAIT_S:
        unexplained_s += silent_s
    elif unexplained_s:
        unexplained_s -= FADE_SHARE * silent_s
        unexplained_s = unexplained_s if unexplained_s > 0 else 0.0
    return EncoderTimeoutState(now_s, False, state.awaits_echo, silent_s, state.missed_s, unexplained_s)


def note_echo(
    params: EncoderTimeoutParameters, state: EncoderTimeoutState, now_s: float, *, is_missing: bool
) -> EncoderTimeoutState:
    """A board that waits for its echoes has told of one, or that none came."""
    silent_s = now_s - state.heard_s
    if silent_s <= params.max_age_s:
        silent_s = state.silent_s
    awaits_echo = is_missing and params.max_age_s < silent_s <= WAIT_S
    return replace(state, awaits_echo=awaits_echo, missed_s=now_s if awaits_echo else state.missed_s)


def awaits_echo(params: EncoderTimeoutParameters, state: EncoderTimeoutState, now_s: float) -> bool:
    """Whether the robot may only crawl, since the board waits for an echo, or will; with no longer silence than that."""
    return state.awaits_echo and params.silent_speed_m_s > 0 and now_s - state.heard_s <= WAIT_S


def may_await_echo(params: EncoderTimeoutParameters, state: EncoderTimeoutState, now_s: float) -> bool:
    """Whether this silence may be another wait for an echo, as there was one lately."""
    waits_lately = now_s - state.missed_s <= LATELY_S
    return waits_lately and params.silent_speed_m_s > 0 and now_s - state.heard_s <= WAIT_S


def update(
    params: EncoderTimeoutParameters, state: EncoderTimeoutState, now_s: float, *, driven: bool
) -> tuple[EncoderTimeoutState, Fault | None]:
    """The encoders are stale: ``driven`` says whether a duty other than zero is in force."""
    interrupted = state.interrupted or driven
    silent_s = now_s - state.heard_s
    earlier_s = state.unexplained_s if silent_s > WAIT_S else 0.0
    if not interrupted or silent_s + earlier_s <= params.latch_after_s:
        return replace(state, interrupted=interrupted), None
    if earlier_s:
        reason = Sentence(
            "driving.encoders_silent_again",
            "no encoder reading for {silent_s:.1f} s, and shortly before for {earlier_s:.1f} s in all, while the robot "
            "was driven: check that the board runs, that its sketch still sends encoder readings, and the cable",
            silent_s=silent_s,
            earlier_s=earlier_s,
        )
    else:
        reason = Sentence(
            "driving.encoders_silent",
            "no encoder reading for {silent_s:.1f} s while the robot was driven: "
            "check that the board runs, that its sketch still sends encoder readings, and the cable",
            silent_s=silent_s,
        )
    return EncoderTimeoutState(state.heard_s, missed_s=state.missed_s), Fault(
        FaultKind.ENCODERS_SILENT, reason
    )
