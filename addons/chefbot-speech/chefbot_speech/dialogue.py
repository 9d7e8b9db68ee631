"""What becomes of what somebody says: a pure table of steps, without clock, sound or robot.

Pressing brakes. A goal is only proposed, shown and spoken; it begins with a yes, or where a countdown is configured at
its end. Whatever is not understood begins nothing.
"""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

from chefbot_speech.commands import Action, Command

PATIENCE_S: Final = 30.0
"""A proposal that nobody answers is forgotten after this time."""


class Phase(StrEnum):
    """What the one who talks can do next."""

    READY = "ready"
    LISTENING = "listening"
    THINKING = "thinking"


class Effect(StrEnum):
    """What the robot is to do."""

    STOP = "stop"
    GO = "go"


@dataclass(frozen=True, slots=True)
class Dialogue:
    """``proposal`` is the place that waits for a yes, until ``forget_s``; at ``start_s`` it begins by itself."""

    phase: Phase = Phase.READY
    proposal: str = ""
    forget_s: float = 0.0
    start_s: float | None = None


@dataclass(frozen=True, slots=True)
class Step:
    """The next dialogue, what the robot says, and what it does: for ``GO`` to ``place``."""

    dialogue: Dialogue
    text: str = ""
    effect: Effect | None = None
    place: str = ""


def press(dialogue: Dialogue) -> Step:
    """Talk is pressed: the robot brakes, and no countdown goes on. A proposal can still be answered."""
    return Step(replace(dialogue, phase=Phase.LISTENING, start_s=None), effect=Effect.STOP)


def release(dialogue: Dialogue) -> Step:
    """Talk is released: what was said is being recognized."""
    if dialogue.phase is not Phase.LISTENING:
        return Step(dialogue)
    return Step(replace(dialogue, phase=Phase.THINKING))


def touch(dialogue: Dialogue) -> Step:
    """The page was touched: no goal begins by itself."""
    return Step(replace(dialogue, start_s=None))


def interrupt(dialogue: Dialogue) -> Step:
    """Somebody talks on another page, or the robot was stopped: what was proposed begins after a yes only."""
    if dialogue.start_s is None:
        return Step(dialogue)
    return Step(replace(dialogue, start_s=None), f"Go to {dialogue.proposal}? Say or touch yes.")


def postpone(dialogue: Dialogue) -> Step:
    """What was to begin while somebody talks on another page begins after another yes."""
    waiting = replace(dialogue, phase=Phase.READY, start_s=None)
    return Step(waiting, f"Somebody talks. Go to {dialogue.proposal}? Say or touch yes.")


def hear(dialogue: Dialogue, command: Command | None, now_s: float, countdown_s: float | None) -> Step:
    """What was said while talk was pressed; None: it was not understood. Anything else comes too late."""
    if dialogue.phase is not Phase.THINKING:
        return Step(dialogue)
    ready = replace(_in_time(dialogue, now_s), phase=Phase.READY)
    if command is None:
        again = f"I did not understand. Shall I go to {ready.proposal}?" if ready.proposal else ""
        return Step(ready, again or "I did not understand. I stay here.")
    if command.action is Action.GO:
        start_s = None if countdown_s is None else now_s + countdown_s
        text = f"Go to {command.place}? " + (
            "Say or touch yes." if countdown_s is None else f"I start in {countdown_s:g} seconds."
        )
        return Step(Dialogue(Phase.READY, command.place, (start_s or now_s) + PATIENCE_S, start_s), text)
    return answer(ready, command.action, now_s)


def _in_time(dialogue: Dialogue, now_s: float) -> Dialogue:
    """Without a proposal that nobody has answered in time, whatever phase that time has passed in."""
    return dialogue if now_s < dialogue.forget_s else Dialogue(dialogue.phase)


def answer(dialogue: Dialogue, action: Action, now_s: float) -> Step:
    """An answer by voice or by a button. While somebody talks, nothing begins; nor by an answer that comes too late."""
    dialogue = _in_time(dialogue, now_s)
    ready = Dialogue(dialogue.phase)
    if action is Action.YES and dialogue.phase is not Phase.READY:
        return Step(dialogue)
    if action is Action.YES and dialogue.proposal:
        return Step(ready, f"I am going to {dialogue.proposal}.", Effect.GO, dialogue.proposal)
    if action is Action.YES:
        return Step(ready, "I have asked nothing.")
    if action is Action.STOP:
        return Step(ready, "I stand.", Effect.STOP)
    return Step(ready, "I stay here." if dialogue.proposal else "I stand, and go nowhere.")


def look(dialogue: Dialogue, now_s: float) -> Step:
    """Time has passed."""
    if dialogue.proposal and dialogue.phase is Phase.READY:
        if dialogue.start_s is not None and now_s >= dialogue.start_s:
            return answer(dialogue, Action.YES, now_s)
        if now_s >= dialogue.forget_s:
            return Step(Dialogue(), f"Nobody answered: I do not go to {dialogue.proposal}.")
    return Step(dialogue)
