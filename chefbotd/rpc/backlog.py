"""What a client has sent and has not been served yet: lines in their order, and a way to see a stop among them early.

Pure: it holds bytes and cuts lines, and knows what a stop looks like only by a pattern.
"""

import re
from typing import NamedTuple

from chefbotd.rpc.arrivals import Arrival


class Line(NamedTuple):
    """A line without its end, and when its first byte came."""

    text: bytearray
    arrival: Arrival


class Mark(NamedTuple):
    """From this position on, up to the next mark, bytes came at the same time."""

    position: int
    arrival: Arrival


class Backlog:
    """Lines of at most ``longest_bytes``; ``hint`` is found in every line that may have to be taken out early."""

    def __init__(self, longest_bytes: int, hint: re.Pattern[bytes]) -> None:
        self._longest_bytes, self._hint = longest_bytes, hint
        self._bytes = bytearray()
        self._marks: list[Mark] = []
        self._cut = 0  # where the line stood that was taken last
        self._seen = 0  # up to here there is nothing more to be found
        self._found = slice(0, 0)
        self._skips = False

    def __len__(self) -> int:
        return len(self._bytes)

    @property
    def unfinished(self) -> bool:
        """Whether a line has begun and not ended, and it is the only one."""
        return bool(self._bytes) and self._bytes.find(b"\n") < 0

    @property
    def too_long(self) -> bool:
        """Whether the next line is longer than any may be, or will be."""
        end = self._bytes.find(b"\n")
        return (len(self._bytes) if end < 0 else end) > self._longest_bytes

    def add(self, data: bytes, arrival: Arrival) -> None:
        """Bytes from the client, cut anywhere."""
        if self._skips:
            _, line_end, data = data.partition(b"\n")
            self._skips = not line_end
        if data and (not self._marks or self._marks[-1].arrival != arrival):
            self._marks.append(Mark(len(self._bytes), arrival))
        self._bytes += data

    def finish(self) -> None:
        """No more will come: what has no line end yet is the last line."""
        if self._bytes and not self._bytes.endswith(b"\n"):
            self._bytes += b"\n"

    def first(self) -> bytearray:
        """The next line, which stays; empty when it is not complete."""
        return self._bytes[: max(0, self._bytes.find(b"\n"))]

    def take(self) -> Line | None:
        """The next line; None when it is not complete."""
        end = self._bytes.find(b"\n")
        if end < 0:
            return None
        line = Line(self._bytes[:end].strip(), self._marks[0].arrival)
        self._remove(0, end + 1)
        return line

    def find(self) -> bytearray | None:
        """The next complete line, of those that were not found before, in which the hint is; it stays."""
        last_end = self._bytes.rfind(b"\n") + 1
        while (hint := self._hint.search(self._bytes, self._seen, last_end)) is not None:
            start = self._bytes.rfind(b"\n", 0, hint.start()) + 1
            end = self._bytes.find(b"\n", hint.end())
            self._seen = end + 1
            if end - start <= self._longest_bytes:
                self._found = slice(start, end + 1)
                return self._bytes[start:end].strip()
        self._seen = last_end
        return None

    def take_found(self) -> None:
        """Take out what was found last."""
        self._remove(self._found.start, self._found.stop)

    def stopped(self, before: int, now: int) -> None:
        """The line that was taken last was a stop, by which there have been ``now``: what stands behind it came later.

        Unless that had come before another stop already.
        """
        if self._cut >= len(self):
            return
        before_it = [mark for mark in self._marks if mark.position < self._cut]
        behind = [mark for mark in self._marks if mark.position >= self._cut]
        if not behind or behind[0].position > self._cut:
            behind.insert(0, Mark(self._cut, before_it[-1].arrival))
        self._marks = before_it + [
            mark._replace(arrival=mark.arrival._replace(stops=now)) if mark.arrival.stops == before else mark
            for mark in behind
        ]

    def _remove(self, start: int, end: int) -> None:
        del self._bytes[start:end]
        self._cut = start
        self._seen = _after_removal(self._seen, start, end)
        marks = {_after_removal(mark.position, start, end): mark.arrival for mark in self._marks}
        marks.pop(len(self._bytes), None)
        self._marks = [Mark(position, arrival) for position, arrival in marks.items()]

    def drop_seen(self) -> None:
        """Forget what nothing more can be found in; so also a line that is too long already."""
        self._remove(0, self._seen)
        if len(self._bytes) > self._longest_bytes and self._bytes.find(b"\n") < 0:
            self.clear()
            self._skips = True

    def clear(self) -> None:
        """Forget everything."""
        self._bytes.clear()
        self._marks.clear()
        self._cut = self._seen = 0


def _after_removal(position: int, start: int, end: int) -> int:
    return min(position, start) if position < end else position - (end - start)
