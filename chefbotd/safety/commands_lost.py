"""Detects a line on which no command reaches the board, before a wheel is blamed for standing.

Our own firmware says when its dead-man has stopped the motors. While the robot is driven, that means that no command
came through: the cable is cut in this direction, or damages every line. At rest the dead-man is in force, too, and it
stays so until the first command has arrived. So the time in which it is driven in vain is added up, and the time in
which commands arrive is taken off again: a line that loses some of them drives on.
"""

from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence
from chefbotd.safety.faults import Fault, FaultKind

LOST_S = 1.0
"""For so long all commands must be lost: four of the usual dead-man times, and less than a stalled wheel takes."""


class BoardSays(Record, frozen=True):
    """What the board has said last: whether its dead-man is in force, and its counters of our lines."""

    dead_man: bool = False
    damaged: int = 0
    refused: int = 0


def watch(lost_s: float, says: BoardSays, dt_s: float, *, driven: bool) -> tuple[float, Fault | None]:
    """A reading, ``dt_s`` after the last one: for how long commands were lost, and the fault when it is too long.

    ``driven``: a duty other than zero was written last. A fault is told once.
    """
    if not says.dead_man:
        return (lost_s - dt_s if lost_s > dt_s else 0.0), None
    if not driven:
        return lost_s, None
    if lost_s + dt_s < LOST_S:
        return lost_s + dt_s, None
    return 0.0, _explain(lost_s + dt_s, says)


def _explain(lost_s: float, says: BoardSays) -> Fault:
    reason = Sentence(
        "driving.commands_lost",
        "no command reaches the board: its dead-man has kept the motors off for {lost_s:.1f} s in which it was sent "
        "commands, and so far it has counted {damaged} damaged lines and {refused} that it refused. The "
        "wheels are not to blame: check the cable to the board, its plugs, and what runs beside it",
        lost_s=lost_s,
        damaged=says.damaged,
        refused=says.refused,
    )
    return Fault(FaultKind.COMMANDS_LOST, reason)


def explain_unheard(wheels_fault: Fault, shown: tuple[float, ...], sent: tuple[int, ...]) -> Fault:
    """The fault of a line behind which a wheel stands as the board's echo has it: ``shown``, where ``sent`` was sent."""
    shown_text, sent_text = " ".join(f"{value:g}" for value in shown), " ".join(map(str, sent))
    reason = Sentence(
        "driving.commands_unheard",
        "no command reaches the board: it echoes {shown!r}, where {sent!r} was sent, so it says that it "
        "drives no motor. Check the cable to the board and its plugs, and whether the board stops its motors by itself. "
        "If its 's' lines mean something else: {why}",
        shown=shown_text,
        sent=sent_text,
        why=wheels_fault.reason,
    )
    return Fault(FaultKind.COMMANDS_LOST, reason)
