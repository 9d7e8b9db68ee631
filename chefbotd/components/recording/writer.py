"""The recording thread: it waits for the disk, and the control thread only queues chunks for it.

What waits is bounded in bytes. Chunks that find no room are given up; their events are counted, and the recording says
where they are missing.
"""

import queue
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, TypeVar

import structlog

from chefbotd.components.recording.status import RecordingError
from chefbotd.core.commands import RefusalKind
from chefbotd.core.events.robot import RecordingData

if TYPE_CHECKING:
    from chefbotd.components.recording.chunk_encoder import ChunkEncoder
    from chefbotd.components.recording.recorder import Recorder

T = TypeVar("T")

log = structlog.get_logger(component="recording")

NO_ROOM = "the disk was too slow, or did not answer"
MOST_ASKED = 64
"""Clients that ask again and again while the disk hangs fill no memory."""

MakeRecorder: TypeAlias = Callable[[], tuple["ChunkEncoder", "Recorder"]]
"""Makes what encodes events, and what records them. Their modules are loaded then."""


class Writer(Protocol):
    """Where events are left, once it is ``ready``. ``status`` is how the recorder stood a moment ago."""

    dropped: int

    @property
    def ready(self) -> "Future[None]":
        """Done when the recorder is made; has its error where it cannot be."""
        ...

    @property
    def done(self) -> int:
        """Events that the thread has taken."""
        ...

    @property
    def status(self) -> RecordingData:
        """How the recorder stands."""
        ...

    @property
    def waiting(self) -> int:
        """Events that the thread has not taken yet."""
        ...

    def put_events(self, events: Sequence[Any], now_s: float) -> None:
        """Leave events; never waits."""
        ...

    def note_dropped(self, count: int) -> None:
        """Events were given up before they came here."""
        ...

    def ask(self, work: "Callable[[Recorder], T]", now_s: float, *, first: bool = False) -> "Future[T]":
        """Have something done with the recorder, after what was left before, or ``first``."""
        ...


class _Queue:
    """What both writers have in common: encoder, recorder and gaps. ``_put`` takes work for the recorder."""

    _encoder: "ChunkEncoder"
    recorder: "Recorder"

    def __init__(self, make: MakeRecorder, most_bytes: int) -> None:
        self._make, self._most_bytes = make, most_bytes
        self.ready: Future[None] = Future()
        self._given = self._given_bytes = self._recorded = self._recorded_bytes = 0
        self._gap, self._marked = 0, False
        self._asked = self._carried_out = 0
        self.dropped = 0

    def make(self) -> None:
        """Make the recorder."""
        self._encoder, self.recorder = self._make()
        self.ready.set_result(None)

    @property
    def status(self) -> RecordingData:
        """How the recorder stood a moment ago."""
        return self.recorder.status

    @property
    def done(self) -> int:
        """Events that the recorder has taken."""
        return self._recorded

    @property
    def waiting(self) -> int:
        """Events that the recorder has not taken yet."""
        return self._given - self._recorded

    def put_events(self, events: Sequence[Any], now_s: float) -> None:
        """Encode events, and leave a chunk where one is due: all of it or, where there is no room, none."""
        if self._gap and not self._marked:
            self._encoder.mark_gap(self._gap, NO_ROOM, now_s)
            self._marked = True
        self._encoder.encode(events)
        if self._encoder.is_due(now_s):
            self._cut(now_s)

    def note_dropped(self, count: int) -> None:
        """Count them; the recording says so as soon as it goes on."""
        self._encoder.skip(count)
        self.dropped += count
        self._gap += count

    def ask(self, work: "Callable[[Recorder], T]", now_s: float, *, first: bool = False) -> "Future[T]":
        """Have the recorder do something, after all that was left before; cancel it while it has not begun.

        ``first``: before what is in no chunk yet. The future has a ``RecordingError`` where ``MOST_ASKED`` wait already.
        """
        if not first:
            self._cut(now_s)
        future: Future[T] = Future()
        if self._asked - self._carried_out >= MOST_ASKED:
            future.set_exception(RecordingError(RefusalKind.STORAGE_FAILED, NO_ROOM))
            return future
        self._asked += 1

        def carry_out(recorder: "Recorder") -> None:
            self._carried_out += 1
            _carry_out(work, recorder, future)

        self._put(carry_out)
        return future

    def _cut(self, now_s: float) -> None:
        chunk = self._encoder.cut(now_s)
        if chunk is None:
            return
        weight, marked, self._marked = chunk.weight, self._marked, False
        if self._given_bytes - self._recorded_bytes + weight > self._most_bytes:
            self.dropped += chunk.events
            self._gap += chunk.events
            return
        if marked:
            self._gap = 0
        self._given += chunk.events
        self._given_bytes += weight

        def record(recorder: "Recorder") -> None:
            recorder.record(chunk, now_s)
            self._recorded += chunk.events
            self._recorded_bytes += weight

        self._put(record)

    def _put(self, work: "Callable[[Recorder], object]") -> None:
        raise NotImplementedError


class InlineWriter(_Queue):
    """Records in the call that leaves the events: for a virtual clock, which waits for no thread."""

    def __init__(self, make: MakeRecorder, most_bytes: int) -> None:
        super().__init__(make, most_bytes)
        self.make()

    def _put(self, work: "Callable[[Recorder], object]") -> None:
        work(self.recorder)


class WriterThread(_Queue):
    """Records in a thread, which makes the recorder too. ``most_bytes`` may wait for it."""

    def __init__(self, make: MakeRecorder, most_bytes: int) -> None:
        super().__init__(make, most_bytes)
        self._work: queue.SimpleQueue[Callable[[Recorder], object]] = queue.SimpleQueue()
        threading.Thread(target=self._run_writer, name="recording", daemon=True).start()

    def _put(self, work: "Callable[[Recorder], object]") -> None:
        self._work.put(work)

    def _run_writer(self) -> None:
        try:
            self.make()
        except Exception as error:
            log.error("the recorder cannot start", error=repr(error), exc_info=error)
            self.ready.set_exception(error)
            return
        while True:
            work = self._work.get()
            try:
                work(self.recorder)
            except Exception as error:
                log.error("the recorder has failed", error=repr(error), exc_info=error)


def _carry_out(work: "Callable[[Recorder], T]", recorder: "Recorder", future: "Future[T]") -> None:
    if not future.set_running_or_notify_cancel():
        return
    try:
        future.set_result(work(recorder))
    except Exception as error:  # noqa: BLE001 - whoever asked gets it
        future.set_exception(error)
