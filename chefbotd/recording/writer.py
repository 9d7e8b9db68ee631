"""The thread that records: whatever the disk does, the thread that controls the robot only leaves events there.

What waits is bounded in bytes. Events that find no room are counted, and the recording says where they are missing.
"""

import queue
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import structlog

from chefbotd.recording.status import Status

if TYPE_CHECKING:
    from chefbotd.recording.recorder import Recorder

T = TypeVar("T")

log = structlog.get_logger(component="recording")

EVENTS_AT_ONCE = 64
BREATH_S = 0.0005
"""After so many events the interpreter is let go of, so that control need not wait for its turn."""

EVENT_BYTES = 400
"""What an event takes in memory, about; those with large contents are weighed."""

NO_ROOM = "the disk was too slow, or did not answer"


class Writer(Protocol):
    """Where events are left. ``status`` is how the recorder stood a moment ago."""

    dropped: int

    @property
    def done(self) -> int:
        """Events that the thread has taken."""
        ...

    @property
    def status(self) -> Status:
        """How the recorder stands."""
        ...

    @property
    def waiting(self) -> int:
        """Events that are on their way."""
        ...

    def give(self, events: Sequence[Any], now_s: float) -> None:
        """Leave events; never waits."""
        ...

    def note_dropped(self, count: int) -> None:
        """Events were given up before they came here."""
        ...

    def ask(self, work: "Callable[[Recorder], T]") -> "Future[T]":
        """Have something done with the recorder, after what was left before."""
        ...


def weight(event: Any) -> int:
    """About how many bytes an event takes in memory."""
    for name in ("data", "message", "cells"):
        content = getattr(event, name, None)
        if isinstance(content, bytes):
            return EVENT_BYTES + len(content)
    scan = getattr(event, "scan", None)
    return EVENT_BYTES if scan is None else EVENT_BYTES + 3 * int(scan.range_m.nbytes)


class InlineWriter:
    """Records in the call that leaves the events: for a virtual clock, which waits for no thread."""

    def __init__(self, make: "Callable[[], Recorder]") -> None:
        self.recorder = make()
        self.dropped = self.waiting = self.done = self._gap = 0

    @property
    def status(self) -> Status:
        """How the recorder stands."""
        return self.recorder.status

    def give(self, events: Sequence[Any], now_s: float) -> None:
        """Record them."""
        gap, self._gap = self._gap, 0
        if gap:
            self.recorder.note_gap(gap, NO_ROOM, now_s)
        self.recorder.take(events, now_s)
        self.done += len(events)

    def note_dropped(self, count: int) -> None:
        """Count them."""
        self.dropped += count
        self._gap += count

    def ask(self, work: "Callable[[Recorder], T]") -> "Future[T]":
        """Do it."""
        future: Future[T] = Future()
        _carry_out(work, self.recorder, future)
        return future


class WriterThread:
    """Records in a thread, which ``make`` is called in too. ``most_bytes`` may wait for it."""

    def __init__(self, make: "Callable[[], Recorder]", most_bytes: int) -> None:
        self._make, self._most_bytes = make, most_bytes
        self._work: queue.SimpleQueue[Callable[[Recorder], object]] = queue.SimpleQueue()
        self._recorder: Recorder | None = None
        self._given = self._given_bytes = self._taken = self._taken_bytes = 0
        self.dropped = self._gap = 0
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
        self._thread.start()

    @property
    def status(self) -> Status:
        """How the recorder stood a moment ago."""
        return Status() if self._recorder is None else self._recorder.status

    @property
    def done(self) -> int:
        """Events that the thread has taken."""
        return self._taken

    @property
    def waiting(self) -> int:
        """Events that the thread has not taken yet."""
        return self._given - self._taken

    def give(self, events: Sequence[Any], now_s: float) -> None:
        """Leave events for the thread, all of them or, where there is no room, none."""
        size = sum(map(weight, events))
        if self._given_bytes - self._taken_bytes + size > self._most_bytes:
            self.note_dropped(len(events))
            return
        gap, self._gap = self._gap, 0
        self._given += len(events)
        self._given_bytes += size

        def record(recorder: "Recorder") -> None:
            if gap:
                recorder.note_gap(gap, NO_ROOM, now_s)
            for start in range(0, len(events), EVENTS_AT_ONCE):
                if start:
                    time.sleep(BREATH_S)
                recorder.take(events[start : start + EVENTS_AT_ONCE], now_s)
            self._taken += len(events)
            self._taken_bytes += size

        self._work.put(record)

    def note_dropped(self, count: int) -> None:
        """Count them; the recording says so as soon as it goes on."""
        self.dropped += count
        self._gap += count

    def ask(self, work: "Callable[[Recorder], T]") -> "Future[T]":
        """Have the thread do something, after all that was left before; cancel it while it has not begun."""
        future: Future[T] = Future()
        self._work.put(lambda recorder: _carry_out(work, recorder, future))
        return future

    def _run(self) -> None:
        try:
            recorder = self._recorder = self._make()
        except Exception as error:
            log.error("the recorder cannot be made", error=repr(error), exc_info=error)
            return
        while True:
            work = self._work.get()
            try:
                work(recorder)
            except Exception as error:
                log.error("the recorder has failed", error=repr(error), exc_info=error)


def _carry_out(work: "Callable[[Recorder], T]", recorder: "Recorder", future: "Future[T]") -> None:
    if not future.set_running_or_notify_cancel():
        return
    try:
        future.set_result(work(recorder))
    except Exception as error:  # noqa: BLE001 - whoever asked gets it
        future.set_exception(error)
