"""The watchdog: a thread that stops the motors when the event loop stands still.

Python code that does not come back to the loop holds up everything, the dead-man too, while the board keeps the last
duty for ever. The thread needs nothing of the loop. What it cannot see past is code that keeps the interpreter's lock,
and what it does not outlive is the process: only firmware with a dead-man of its own covers those.
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
"""Later than the patience, so that the loop has stood for longer than it."""


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
        """Until the next look: on a robot at rest, until the loop can have stood for the patience at the earliest."""
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
