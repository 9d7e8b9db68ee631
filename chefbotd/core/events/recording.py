"""Events of the recorder, for the bus and for its files."""

from chefbotd.core.record import Record


class RecordingChanged(Record, frozen=True):
    """How the recorder stands: ``state`` is idle, recording or failed (``reason`` says why), told once a second.

    ``file`` is the one being written, or the last one; ``dropped`` counts events that found no room since the daemon
    started, ``waiting`` those that are on their way to the writing thread. ``saved`` is the file of the ring that was
    written last. ``free_bytes`` is None until the disk has been asked.
    """

    stamp_s: float
    state: str
    name: str | None
    file: str | None
    seconds: float
    bytes_written: int
    messages: int
    dropped: int
    waiting: int
    ring_s: float
    ring_bytes: int
    free_bytes: int | None
    saved: str | None
    reason: str


class EventsDropped(Record, frozen=True):
    """A gap in the recording: so many events found no room just before; ``reason`` is for people."""

    stamp_s: float
    count: int
    reason: str
