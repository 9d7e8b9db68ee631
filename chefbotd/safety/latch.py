"""What the next daemon is told of the gate: its mode, reason and fault.

A daemon that runs armed stores that too, and removes it when it ends in order. So a daemon that finds it knows that
its predecessor was killed or crashed, perhaps with the robot in motion.
"""

from pathlib import Path
from typing import Annotated, Protocol

import msgspec

from chefbotd.core.parameters import Parameters
from chefbotd.core.sentence import Sentence
from chefbotd.safety.faults import FaultKind
from chefbotd.safety.gate import GateState, Mode

MAX_REASON_CHARACTERS = 1000

UNCLEAN_SHUTDOWN = GateState(
    Mode.DISARMED,
    Sentence(
        "driving.unclean_shutdown",
        "the previous daemon did not shut down properly; arm the robot when it may move",
    ),
    fault=FaultKind.UNCLEAN_SHUTDOWN,
)
UNREADABLE = GateState(
    Mode.DISARMED,
    Sentence(
        "driving.latch_unreadable",
        "the state of the previous daemon cannot be read, and the log says why; arm the robot when it may move",
    ),
    fault=FaultKind.UNCLEAN_SHUTDOWN,
)


def unwritable(problem: str) -> GateState:
    """Where a latch is configured and cannot be written, a restart would forget an e-stop: the robot stays disarmed."""
    return GateState(Mode.DISARMED, why_unwritable(problem), fault=FaultKind.LATCH_UNWRITABLE)


def why_unwritable(problem: str) -> Sentence:
    """For people."""
    return Sentence(
        "driving.latch_unwritable",
        "the latch file cannot be written ({problem}); make room for it, then arm the robot",
        problem=problem,
    )


class LatchParameters(Parameters):
    """``folder`` is where the file is; without one the state of the gate does not outlive the daemon."""

    folder: Path | None = None


class GateStore(Protocol):
    """Where the state of the gate is kept beyond the end of the process. What cannot be kept raises nothing."""

    def recall(self) -> GateState:
        """The state to begin in."""
        ...

    def keep(self, state: GateState) -> str:
        """Store a state, in place of the one before. Why it cannot be stored; empty: it is."""
        ...

    def end(self) -> None:
        """The daemon ends in order: forget a state that is armed."""
        ...


class Latch(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The gate's mode, and why it is so."""

    mode: Mode
    fault: FaultKind | None
    reason: Annotated[str, msgspec.Meta(max_length=MAX_REASON_CHARACTERS)]


def write(state: GateState) -> bytes:
    """The state as JSON in UTF-8, whatever characters the reason has. A long reason is cut."""
    reason = state.reason[:MAX_REASON_CHARACTERS].encode(errors="replace").decode()
    return msgspec.json.encode(Latch(state.mode, state.fault, reason))


def read(left: bytes) -> GateState:
    """The state to begin in, which is never armed.

    Raises:
        ValueError: these are not bytes that ``write`` has made.
    """
    try:
        latch = msgspec.json.decode(left, type=Latch)
    except ValueError as error:
        raise ValueError(f"not what a daemon wrote: {error}") from error
    if latch.mode is Mode.ARMED:
        return UNCLEAN_SHUTDOWN
    return GateState(latch.mode, latch.reason, fault=latch.fault)
