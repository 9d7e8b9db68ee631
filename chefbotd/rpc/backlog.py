"""The received bytes of a client that wait: lines in order, searched once for urgent ones.

Pure: it holds bytes and cuts lines. A pattern tells it which lines may be urgent.
"""

import re

from chefbotd.core.record import Record, replace
from chefbotd.rpc.arrivals import ByteArrival


class ReceivedLine(Record, frozen=True):
    """A line without its end, and the arrival of its first byte."""

    text: bytearray
    arrival: ByteArrival


class Mark(Record, frozen=True):
    """The bytes from this position to the next mark arrived together."""

    position: int
    arrival: ByteArrival


class Backlog:
    """Lines of at most ``longest_bytes``; ``urgent_pattern`` matches in every line that may be urgent."""

    def __init__(self, longest_bytes: int, urgent_pattern: re.Pattern[bytes]) -> None:
        self._longest_bytes, self._urgent_pattern = longest_bytes, urgent_pattern
        self._bytes = bytearray()
        self._marks: list[Mark] = []
        self._taken_at = 0  # the position of the line that was taken last
        self._searched = 0  # up to here every urgent line was found
        self._urgent_at = slice(0, 0)
        self._skips_line = False

    def __len__(self) -> int:
        return len(self._bytes)

    @property
    def unfinished(self) -> bool:
        """Whether all that waits is one unfinished line."""
        return bool(self._bytes) and self._bytes.find(b"\n") < 0

    @property
    def too_long(self) -> bool:
        """Whether the next line is longer than any may be, or will be."""
        if len(self._bytes) <= self._longest_bytes:
            return False
        end = self._bytes.find(b"\n")
        return (len(self._bytes) if end < 0 else end) > self._longest_bytes

    def add(self, data: bytes, arrival: ByteArrival) -> None:
        """Add bytes from the client, cut anywhere."""
        if self._skips_line:
            _, line_end, data = data.partition(b"\n")
            self._skips_line = not line_end
        if data and (not self._marks or self._marks[-1].arrival != arrival):
            self._marks.append(Mark(len(self._bytes), arrival))
        self._bytes += data

    def finish(self) -> None:
        """No more bytes come: what has no line end yet is the last line."""
        if self._bytes and not self._bytes.endswith(b"\n"):
            self._bytes += b"\n"

    def first_line(self) -> bytearray:
        """The next line, without removing it; empty when it is incomplete."""
        return self._bytes[: max(0, self._bytes.find(b"\n"))]

    def take_line(self) -> ReceivedLine | None:
        """Remove and return the next line; None when it is incomplete."""
        end = self._bytes.find(b"\n")
        if end < 0:
            return None
        line = ReceivedLine(self._bytes[:end].strip(), self._marks[0].arrival)
        self._remove(0, end + 1)
        return line

    def find_urgent(self) -> bytearray | None:
        """The next complete line that may be urgent and was not found before; it stays in the backlog."""
        last_end = self._bytes.rfind(b"\n") + 1
        while (match := self._urgent_pattern.search(self._bytes, self._searched, last_end)) is not None:
            start = self._bytes.rfind(b"\n", 0, match.start()) + 1
            end = self._bytes.find(b"\n", match.end())
            self._searched = end + 1
            if end - start <= self._longest_bytes:
                self._urgent_at = slice(start, end + 1)
                return self._bytes[start:end].strip()
        self._searched = last_end
        return None

    def remove_found(self) -> None:
        """Remove the line that was found last."""
        self._remove(self._urgent_at.start, self._urgent_at.stop)

    def record_own_stop(self, before: int, now: int) -> None:
        """The line that was taken last was a stop, number ``now`` after ``before``: the lines behind it are newer.

        Lines that arrived before another client's stop stay older than that one.
        """
        if self._taken_at >= len(self):
            return
        before_it = [mark for mark in self._marks if mark.position < self._taken_at]
        behind = [mark for mark in self._marks if mark.position >= self._taken_at]
        if not behind or behind[0].position > self._taken_at:
            behind.insert(0, Mark(self._taken_at, before_it[-1].arrival))
        self._marks = before_it + [
            replace(mark, arrival=replace(mark.arrival, stops=now)) if mark.arrival.stops == before else mark
            for mark in behind
        ]

    def _remove(self, start: int, end: int) -> None:
        if start == 0 and end == len(self._bytes):
            self.clear()
            return
        del self._bytes[start:end]
        self._taken_at = start
        self._searched = _after_removal(self._searched, start, end)
        marks = {_after_removal(mark.position, start, end): mark.arrival for mark in self._marks}
        marks.pop(len(self._bytes), None)
        self._marks = [Mark(position, arrival) for position, arrival in marks.items()]

    def drop_searched(self) -> None:
        """Drop what was searched, and a line that is too long already."""
        self._remove(0, self._searched)
        if len(self._bytes) > self._longest_bytes and self._bytes.find(b"\n") < 0:
            self.clear()
            self._skips_line = True

    def take_searched(self) -> bytes:
        """Remove and return the lines that were searched, in their order; none of them is urgent."""
        lines = bytes(self._bytes[: self._searched])
        self._remove(0, self._searched)
        return lines

    def clear(self) -> None:
        """Drop everything."""
        self._bytes.clear()
        self._marks.clear()
        self._taken_at = self._searched = 0


def _after_removal(position: int, start: int, end: int) -> int:
    return min(position, start) if position < end else position - (end - start)
