"""Turns events into messages in the control thread, in a few microseconds each.

Python runs one thread at a time. A thread that encoded them would keep control waiting whenever the computer is busy and
gives that thread no processor. The thread that writes compresses and waits for the disk, and lets others run meanwhile.
"""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import structlog
from msgspec import Struct

from chefbotd.components.recording.chunk import Channels, ChunkBuilder, RawChunk
from chefbotd.components.recording.encoder import Encoder, MapEvent
from chefbotd.core.events.robot import EventsDropped

log = structlog.get_logger(component="recording")

CHUNK_BYTES = 1 << 20
EARLY_S = 0.02
"""Events come in ten times a second: a chunk that is nearly due does not wait for those of the next time."""


class EventChunk(Struct, frozen=True):
    """A chunk on its way. ``holds`` is what still holds at its end, to be told again where a file begins after it.

    ``maps`` are events whose map the thread draws.
    """

    raw: RawChunk
    events: int
    holds: tuple[tuple[int, bytes], ...]
    maps: tuple[MapEvent, ...]

    @property
    def weight(self) -> int:
        """About how many bytes it takes in memory."""
        return self.raw.weight + sum(len(getattr(drawn[0], "cells", b"")) for drawn in self.maps)


class ChunkEncoder:
    """Encodes events until a chunk is due: after ``chunk_s``, or when it is large. ``offset_ns`` as in ``Encoder``.

    ``failures`` counts events that cannot be recorded, by their class.
    """

    def __init__(
        self, channels: Channels, offset_ns: int, first_scanner: str | None, chunk_s: float, started_s: float
    ) -> None:
        self.channels, self.offset_ns = channels, offset_ns
        self._builder, self._chunk_s, self._began_s = ChunkBuilder(), chunk_s, started_s
        self._encoder = Encoder(self._builder, channels, offset_ns, first_scanner)
        self._events = 0
        self.failures: Counter[str] = Counter()

    @property
    def events(self) -> int:
        """Those that are in no chunk yet."""
        return self._events

    def encode(self, events: Sequence[Any]) -> None:
        """Encode these."""
        encode_event = self._encoder.encode_event
        for event in events:
            try:
                encode_event(event)
            except Exception as error:  # noqa: BLE001 - told; neither control nor the other events are to suffer
                self._note_failure(type(event).__name__, error)
        self._events += len(events)

    def _note_failure(self, name: str, error: Exception) -> None:
        self.failures[name] += 1
        if self.failures[name] == 1:
            log.error("events of a class cannot be recorded", event_class=name, error=repr(error))

    def skip(self, count: int) -> None:
        """So many events were given up before they came here: their numbers are missing."""
        self._encoder.sequence += count

    def mark_gap(self, count: int, reason: str, now_s: float) -> None:
        """Say that events are missing here."""
        self._encoder.encode_event(EventsDropped(now_s, count, reason))

    def is_due(self, now_s: float) -> bool:
        """Whether a chunk is to be cut."""
        return self._builder.size >= CHUNK_BYTES or now_s - self._began_s >= self._chunk_s - EARLY_S

    def cut(self, now_s: float) -> EventChunk | None:
        """What was encoded since the last cut; None where that is nothing."""
        self._began_s = now_s
        raw, events, self._events = self._builder.cut(), self._events, 0
        if raw is None:
            return None
        return EventChunk(raw, events, self._encoder.holds(), self._encoder.take_maps())
