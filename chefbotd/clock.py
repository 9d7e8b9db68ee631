"""The clock of the running daemon, and a virtual one on which minutes pass in milliseconds."""

import asyncio
import selectors
import time
from collections.abc import Callable, Coroutine
from typing import Any, Protocol, TypeVar
from weakref import WeakKeyDictionary

T = TypeVar("T")


class Clock(Protocol):
    """Monotonic time in seconds; its zero means nothing."""

    def now_s(self) -> float:
        """Seconds on this clock."""
        ...


class SystemClock:
    """The kernel's clock since boot, which goes on while the computer sleeps: what was said before that is old.

    uvloop's own ``loop.time`` does not, is cached, and counts whole milliseconds.
    """

    def now_s(self) -> float:
        """Seconds since an arbitrary instant, never going back."""
        return time.clock_gettime(time.CLOCK_BOOTTIME)


def suspended_s() -> float:
    """How long the computer has been suspended since it was started, in seconds: what ``time.monotonic`` leaves out."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.clock_gettime(time.CLOCK_MONOTONIC)


class LoopClock:
    """The running event loop's time: virtual on a ``VirtualLoop``."""

    def now_s(self) -> float:
        """The loop's time in seconds."""
        return asyncio.get_running_loop().time()


BEAT_S = 0.05
EARLIEST_BEATS = 0.2
"""Timers count milliseconds: one that fires just before its beat must not be set for the same beat again."""

_Waiters = dict[int, list["asyncio.Future[None]"]]
_beats: WeakKeyDictionary[asyncio.AbstractEventLoop, _Waiters] = WeakKeyDictionary()


async def next_beat(clock: Clock, beats: int = 1) -> float:
    """Sleep until the clock shows a multiple of ``beats`` times ``BEAT_S``; returns the seconds that it was to take.

    All that waits for the same beat is woken by one timer. To wake an idle process costs more than what it then does, so
    regular work that may as well be done together waits here.
    """
    loop, now_s = asyncio.get_running_loop(), clock.now_s()
    beat = int(now_s / BEAT_S + EARLIEST_BEATS) // beats * beats + beats
    wait_s, waiters = beat * BEAT_S - now_s, _beats.setdefault(loop, {})
    waiter = loop.create_future()
    if beat in waiters:
        waiters[beat].append(waiter)
    else:
        waiters[beat] = [waiter]
        loop.call_later(wait_s, _strike, waiters, beat)
    await waiter
    return wait_s


def _strike(waiters: _Waiters, beat: int) -> None:
    for waiter in waiters.pop(beat):
        if not waiter.done():
            waiter.set_result(None)


class ManualClock:
    """A clock that stands still until it is told otherwise."""

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s

    def now_s(self) -> float:
        """The time last set."""
        return self._now_s

    def advance(self, seconds: float) -> None:
        """Move forward by ``seconds``; raises ``ValueError`` when that is negative."""
        if not seconds >= 0:
            raise ValueError(f"seconds must be >= 0, got {seconds}")
        self._now_s += seconds


class Deadlock(RuntimeError):
    """Nothing is scheduled on a virtual loop, so its time would stand still for ever."""


START_S = 1000.0
"""Where the time of a virtual loop begins."""


class _JumpingSelector(selectors.DefaultSelector):
    """Polls for I/O; where the loop would have waited, its time jumps instead."""

    elapsed_s = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready = super().select(0)
        if ready or timeout == 0:
            return ready
        if timeout is None:
            raise Deadlock(
                "every task waits and no timer is set: nothing can ever happen on the virtual clock"
            )
        self.elapsed_s += max(timeout, 0.0)
        return ready


class VirtualLoop(asyncio.SelectorEventLoop):
    """An event loop whose time passes only when every task waits, and then at once.

    Everything inside one process is exact and repeatable on it: timers, queues, in-memory transports and
    loopback sockets with both ends in the process. What would run in a thread (``asyncio.to_thread``) runs at once.
    What arrives from another process or thread is not waited for.
    """

    def __init__(self) -> None:
        self._jumping = _JumpingSelector()
        super().__init__(self._jumping)

    def time(self) -> float:
        """Virtual seconds."""
        return START_S + self._jumping.elapsed_s

    def run_in_executor(  # type: ignore[override]
        self, executor: object, func: Callable[..., T], *args: Any
    ) -> asyncio.Future[T]:
        """Run it here and now, so that the result does not depend on another thread's time."""
        future: asyncio.Future[T] = self.create_future()
        try:
            future.set_result(func(*args))
        except Exception as error:  # noqa: BLE001 - whoever awaits it gets it, as from a thread
            future.set_exception(error)
        return future

    def stand_still(self, seconds: float) -> None:
        """Let time pass in which nothing runs, as in a process that is frozen: every timer is late by it."""
        if not seconds >= 0:
            raise ValueError(f"seconds must be >= 0, got {seconds}")
        self._jumping.elapsed_s += seconds


def run_virtual(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine to its end on a fresh virtual loop; raises ``Deadlock`` if it can never end."""
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(main)
