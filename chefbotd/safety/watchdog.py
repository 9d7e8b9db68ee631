"""How often the control loop acts without encoders, and how long it may stand still.

After a pause the motors are stopped; one that is long, or one too many, is a fault. The thread that stops them is
``chefbotd.process.watchdog``; what the loop does once it runs again is ``features.driving.service``.
"""

from typing import Final

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.sentence import Sentence
from chefbotd.safety.faults import Fault, FaultKind

COUNTED_S: Final = 60.0
"""Pauses are counted within this time."""


class WatchdogParameters(Parameters):
    """``timeout_s``: how long the control loop may stand still before the motors are stopped.

    A pause while driving disarms if it lasted ``latch_after_s``, or if it is the ``latch_pauses``-th within a minute.
    After any other the robot follows the next command.
    """

    timeout_s: float = Field(default=0.25, ge=0.1, le=5)
    latch_after_s: float = Field(default=1.0, ge=0.1, le=10)
    latch_pauses: int = Field(default=3, ge=1, le=100)


class ControlParameters(Parameters):
    """``watch_period_s``: how long encoders may be silent before the gate is looked at without them.

    ``realtime_priority`` is what the loop asks the computer for (SCHED_FIFO, sched(7); 0: nothing), and ``lock_memory``
    keeps its memory from being swapped out. Neither is needed; without them a busy computer may hold the loop up.
    """

    watch_period_s: float = Field(default=0.02, gt=0, le=0.1)
    """How long encoders may be silent before the safety gate is looked at without them."""
    realtime_priority: int = Field(default=10, ge=0, le=48)
    """The priority that the control loop asks the computer for (SCHED_FIFO, sched(7)); 0: none."""
    lock_memory: bool = True
    """The control loop's memory is kept from being swapped out."""


def judge_pause(
    parameters: WatchdogParameters, pauses_s: tuple[float, ...], now_s: float, stood_s: float
) -> tuple[tuple[float, ...], Fault | None]:
    """A pause while driving ends now; ``pauses_s`` are the ends of those before.

    Returns the ends of all within the last minute, and the fault if it is one.
    """
    recent_s = (*[paused_s for paused_s in pauses_s if now_s - paused_s < COUNTED_S], now_s)
    if stood_s >= parameters.latch_after_s:
        reason = Sentence(
            "driving.loop_stood",
            "the control loop did not run for {stood_s:.2f} s, or the whole program; its log may say why",
            stood_s=stood_s,
        )
    elif len(recent_s) >= parameters.latch_pauses:
        reason = Sentence(
            "driving.loop_stood_often",
            "the control loop stood still {times} times within {within_s:g} s while it drove, "
            "the last time for {stood_s:.2f} s: the computer is too busy",
            times=len(recent_s),
            within_s=COUNTED_S,
            stood_s=stood_s,
        )
    else:
        return recent_s, None
    return recent_s, Fault(FaultKind.LOOP_BLOCKED, reason)
