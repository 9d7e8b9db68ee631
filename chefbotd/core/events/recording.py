"""Events of the recorder, for the bus and for its files."""

from typing import Annotated

from msgspec import Meta

from chefbotd.core.record import Level, LogLine, Record


class RecordingData(Record, frozen=True):
    """The recorder's state; ``reason`` says why recording has ended or is not possible."""

    state: Annotated[str, Meta(description="idle, recording or failed")] = "idle"
    name: str | None = None
    file: Annotated[str | None, Meta(description="the one being written, or the last one")] = None
    seconds: float = 0.0
    bytes_written: int = 0
    messages: int = 0
    dropped: Annotated[int, Meta(description="events that were dropped since the daemon started")] = 0
    waiting: int = 0
    ring_s: float = 0.0
    ring_bytes: int = 0
    free_bytes: int | None = None
    saved: Annotated[str | None, Meta(description="the file that was last saved from memory")] = None
    reason: str = ""


class RecordingChanged(RecordingData, frozen=True, kw_only=True):
    """The recorder's progress, once a second."""

    stamp_s: float


class EventsDropped(Record, frozen=True):
    """A gap in the recording: this many events were dropped just before; ``reason`` is for people."""

    stamp_s: float
    count: int
    reason: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(Level.ERROR, "recording", f"{self.count} events are missing: {self.reason}")
