"""The watchdog: a thread that stops the motors when the event loop stands still.

Python code that does not return to the loop blocks everything, the dead-man too, while the board keeps the last duty
for ever. The thread does not need the loop. It is blocked by code that keeps the interpreter's lock, and it ends with
the process; only firmware with its own dead-man covers these two cases.
"""

import ctypes
import os
import resource
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Final, Protocol, Self

import structlog

from chefbotd.clock import Clock
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.watchdog import WatchdogParameters

# Processor time and memory for the control loop before all other programs, where the computer allows it.
#
# The loop's thread asks for SCHED_FIFO. Only the watchdog's thread has it too, and stands above it: SCHED_RESET_ON_FORK
# (sched(7)) makes every other thread, the worker, the recorder and each other child begin as ordinary ones. Where that
# is not allowed, the loop asks for a negative nice value. Memory in use is locked (mlockall(2)), so that the loop waits
# for no page that was swapped out; MCL_ONFAULT locks what is used, not what is reserved.

log = structlog.get_logger(component="process")

NICE: Final = -10
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4  # mman.h of Linux


class Priority(Record, frozen=True):
    """What the loop was given: a real-time priority (0: none), its nice value, and whether its memory is locked."""

    realtime: int = 0
    nice: int = 0
    memory_locked: bool = False

    def __str__(self) -> str:
        if self.realtime:
            return f"real-time priority {self.realtime}"
        return f"nice {self.nice}" if self.nice else "ordinary priority"


def raise_priority(realtime: int, *, lock_memory: bool) -> Priority:
    """Ask for priority for this thread, which runs the loop, and return what was given. 0 asks for none."""
    given = realtime if realtime and set_realtime(realtime) else 0
    if not given:
        _be_nice()
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    return Priority(given, nice, memory_locked=lock_memory and _lock_memory())


def log_priority(priority: Priority, realtime: int) -> None:
    """Log what was given; a warning if ``realtime`` was asked for and is not allowed."""
    write = log.info if priority.realtime or not realtime else log.warning
    write("the control loop's priority", has=str(priority), memory_locked=priority.memory_locked)


def set_realtime(priority: int) -> bool:
    """Give this thread, but not what it starts, a real-time priority. Returns whether that is allowed."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError:
        return False
    return True


def _be_nice() -> None:
    """Lower this thread's nice value, where that is allowed. What it starts is not below 0 (sched(7))."""
    try:
        if os.getpriority(os.PRIO_PROCESS, 0) > NICE:
            os.setpriority(os.PRIO_PROCESS, 0, NICE)
        os.sched_setscheduler(0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0))
    except OSError:
        return


def _lock_memory() -> bool:
    """Lock memory, but only without a limit: under one, later allocations would fail and end the daemon."""
    limit, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if limit != resource.RLIM_INFINITY and os.geteuid() != 0:
        return False
    try:
        locked: int = ctypes.CDLL(None, use_errno=True).mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT)
    except AttributeError:
        return False
    return locked == 0


LOOKS_PER_PATIENCE = 8
JUST_S = 0.001
"""How much later than the time-out the thread looks, so that the time-out has passed."""


class WatchedLoop(Protocol):
    """The control loop, read from the thread."""

    @property
    def acted_s(self) -> float:
        """When it last ran."""
        ...

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
        """The time until the next look: until the time-out can have passed at the earliest."""
        period_s = self._patience_s / LOOKS_PER_PATIENCE
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
        was_stopped = self._stop()
        if stood_s < self._latch_after_s or not self._control.is_driving:
            return
        if was_stopped:
            reason = Sentence(
                "driving.watchdog_stopped",
                "the control loop did not run for {stood_s:.2f} s and the watchdog stopped the motors; the log may say "
                "why",
                stood_s=stood_s,
            )
        else:
            reason = Sentence(
                "driving.watchdog_failed",
                "the control loop did not run for {stood_s:.2f} s and the board accepted no stop; the log may say why",
                stood_s=stood_s,
            )
        self._report(Fault(FaultKind.LOOP_BLOCKED, reason))
