"""The watchdog: a thread that stops the motors when the event loop stands still.

Python code that does not return to the loop blocks everything, the dead-man too, while the board keeps the last duty
for ever. The thread does not need the loop. It is blocked by code that keeps the interpreter's lock, and it ends with
the process; only firmware with its own dead-man covers these two cases.
"""

import threading
from collections.abc import Callable
from types import TracebackType
from typing import Protocol, Self

from chefbotd.clock import Clock
from chefbotd.process.priority import set_realtime
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.watchdog import WatchdogParameters

LOOKS_PER_PATIENCE = 8
JUST_S = 0.001
"""How much later than the time-out the thread looks, so that the time-out has passed."""


class WatchedLoop(Protocol):
    """The control loop, read from the thread."""

    acted_s: float

    @property
    def is_driving(self) -> bool:
        """Whether the last duty was not zero."""
        ...


class Watchdog:
    """Watches while its context lasts.

    ``stop`` puts a stop on the wire and tells whether it went; ``report``, while the robot is driven and the loop has
    stood for ``latch_after_s``, makes it disarm once it goes on (of a shorter pause it knows itself). Both are called
    from the thread, again and again while the loop stands still: a stop that the loop has said last may be unsent, or
    lost. The clock must be real time. ``realtime_priority`` (0: none) is above the loop's, or a loop that never waits
    would hold up the thread, too.
    """

    def __init__(
        self,
        parameters: WatchdogParameters,
        clock: Clock,
        control: WatchedLoop,
        stop: Callable[[], bool],
        report: Callable[[Fault], None],
        realtime_priority: int = 0,
    ) -> None:
        self._patience_s, self._latch_after_s = parameters.timeout_s, parameters.latch_after_s
        self._clock, self._control = clock, control
        self._stop, self._report, self._priority = stop, report, realtime_priority
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._ended.set()
        self._thread.join()

    def _wait_s(self) -> float:
        """The time until the next look: for a robot at rest, until the time-out can have passed at the earliest."""
        period_s = self._patience_s / LOOKS_PER_PATIENCE
        if self._control.is_driving:
            return period_s
        left_s = self._control.acted_s + self._patience_s - self._clock.now_s()
        return min(max(period_s, left_s + JUST_S), self._patience_s)

    def _watch(self) -> None:
        if self._priority:
            set_realtime(self._priority)
        while not self._ended.wait(self._wait_s()):
            stood_s = self._clock.now_s() - self._control.acted_s
            if stood_s > self._patience_s:
                self._intervene(stood_s)

    def _intervene(self, stood_s: float) -> None:
        outcome = "the watchdog stopped the motors" if self._stop() else "the board accepted no stop"
        if stood_s < self._latch_after_s or not self._control.is_driving:
            return
        reason = f"the control loop did not run for {stood_s:.2f} s and {outcome}; the log may say why"
        self._report(Fault(FaultKind.LOOP_BLOCKED, reason))
