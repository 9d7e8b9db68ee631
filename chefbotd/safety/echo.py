"""Detects a board that reports another command than it was sent.

An `s` line echoes the command in force. It must be one of the recent commands; which one depends on how long the board
takes to read. Zero always fits: a board that boots, or stops the motors by itself, reports it. The echo of some boards
means something else (metres per second). Such an echo never equals a command of ours, and these boards are not judged.

A line may be damaged on its way in either direction, so a single echo that does not fit is no fault. Each of them adds
one to a score, and each echo that fits takes off ``decay_per_match``.
"""

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence
from chefbotd.safety.faults import Fault, FaultKind

Duty = tuple[int, ...]

MOST_SAID = 256
"""Different commands are remembered: more than go out at 200 a second while the sketch waits a second for an echo."""


class EchoParameters(Parameters):
    """A score of ``mismatches`` is a fault; each echo that fits takes off ``decay_per_match``.

    An echo is judged once it has shown ``min_confirmations`` commands other than zero. A command that was last sent
    ``memory_s`` ago must no longer be in force: the sketch reads nothing for up to a second while it waits for an
    ultrasonic echo.
    """

    mismatches: float = Field(default=8.0, ge=2, le=1000)
    decay_per_match: float = Field(default=0.5, gt=0, le=1)
    min_confirmations: int = Field(default=5, ge=1, le=1000)
    memory_s: float = Field(default=3.0, ge=1.5, le=60)


class EchoState(Record, frozen=True):
    """``said``: the recent commands, newest first, each with the time at which it was last sent.

    ``fitting`` counts the echoes that equalled one of them, ``strange`` those before it is believed that were motion and
    did not. ``score`` is what speaks against the board, ``shown`` its latest echo, received at ``shown_s``.
    """

    said: tuple[tuple[float, Duty], ...] = ()
    fitting: int = 0
    score: float = 0.0
    shown: tuple[float, ...] = ()
    shown_s: float = float("-inf")
    strange: int = 0


UNKNOWN = EchoState()
"""A board that was just connected."""


def note_command(state: EchoState, now_s: float, duty: Duty) -> EchoState:
    """A command goes to the board, or may go: one that a newer one replaces is remembered as well."""
    earlier = state.said
    if earlier and earlier[0][1] == duty:
        earlier = earlier[1:]
    return replace(state, said=((now_s, duty), *earlier[: MOST_SAID - 1]))


def is_believed(params: EchoParameters, state: EchoState) -> bool:
    """Whether this board's echo is known to mean the command in force."""
    return state.fitting >= params.min_confirmations


def says_no_motor(state: EchoState) -> bool:
    """Whether the latest echo says that no motor is driven, by a board that has shown no other meaning of its echo."""
    return bool(state.shown) and not any(state.shown) and state.strange <= state.fitting


def note_echo(
    params: EchoParameters, state: EchoState, now_s: float, shown: tuple[float, ...]
) -> tuple[EchoState, Fault | None]:
    """Judge an echo: the next state, and the fault once the score is too high."""
    is_motion = any(shown)
    if not is_motion or _was_said(state, shown, now_s - params.memory_s):
        score = state.score - params.decay_per_match if state.score > params.decay_per_match else 0.0
        fitting = state.fitting + is_motion
        return replace(state, shown=shown, shown_s=now_s, fitting=fitting, score=score), None
    state = replace(state, shown=shown, shown_s=now_s)
    if not is_believed(params, state):
        return replace(state, strange=state.strange + 1), None
    score = state.score + 1
    if score < params.mismatches:
        return replace(state, score=score), None
    return replace(state, score=0.0), _explain(state)


def _was_said(state: EchoState, shown: tuple[float, ...], since_s: float) -> bool:
    """Whether this is a recent command; wheels that stand are not compared."""
    for said_s, duty in state.said:
        if said_s < since_s:
            return False
        if duty == shown or all(now in (0.0, asked) for now, asked in zip(shown, duty, strict=True)):
            return True
    return False


def _explain(state: EchoState) -> Fault:
    shown = " ".join(f"{value:g}" for value in state.shown)
    said = " ".join(map(str, state.said[0][1])) if state.said else "nothing"
    reason = Sentence(
        "driving.echo_mismatch",
        "the board echoes {shown!r}, which it was not sent (last: {sent!r}): check the cable, "
        "that nobody else writes to the port, and the sketch's receive buffer",
        shown=shown,
        sent=said,
    )
    return Fault(FaultKind.ECHO_MISMATCH, reason)
