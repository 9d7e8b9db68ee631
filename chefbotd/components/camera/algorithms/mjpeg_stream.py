"""Finds the pictures in a stream of Motion JPEG, as programs write it to their output: one picture after the other.

Between two pictures there may be anything that is none, such as the heads of a multipart stream.
"""

from collections.abc import Iterator
from typing import Final

from chefbotd.components.camera.algorithms.jpeg import END, START

START_OF_SCAN: Final = b"\xff\xda"


class MjpegStream:
    """Bytes to pictures; how the bytes are chunked makes no difference.

    ``dropped`` counts pictures that were cut by the next one, or longer than ``most_bytes``.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._data = bytearray()
        self._searched = 0
        self._scan, self._head = -1, len(START)
        self.dropped = 0

    def find_pictures(self, data: bytes) -> Iterator[bytes]:
        """The pictures that ``data`` completes; each begins and ends as a JPEG does."""
        self._data += data
        while (picture := self._take_picture()) is not None:
            if picture:
                yield picture

    def _take_picture(self) -> bytes | None:
        """The next one; empty: one was dropped, None: more bytes are needed."""
        held = self._data
        if not held.startswith(START) and not self._skip_to_start():
            return None
        if self._scan < 0:
            place = self._find_head_end()
            if place is None:
                return self._limit_held()
            if held[place : place + 2] != START_OF_SCAN:
                return self._drop_head()
            self._scan, self._searched = place, place + 2
        # Behind the head, 0xFF is followed by 0, by a restart marker, or by what ends the picture (T.81, B.1.1.5).
        cut = held.find(START, self._searched)
        end = held.find(END, self._searched, cut if cut >= 0 else len(held))
        if end < 0 <= cut:
            return self._drop_bytes(cut)
        if end < 0:
            self._searched = max(len(held) - 1, self._searched)
            return self._limit_held()
        picture = bytes(held[: end + 2])
        self._discard_bytes(end + 2)
        if len(picture) > self._most_bytes:
            self.dropped += 1
            return b""
        return picture

    def _find_head_end(self) -> int | None:
        """Where the data begins, or where the head is damaged; None: more bytes are needed.

        The head's segments say how long they are, so what is in them is not mistaken for a marker.
        """
        held, place = self._data, self._head
        while place + 4 <= len(held):
            if held[place] != 0xFF or bytes(held[place : place + 2]) in (START_OF_SCAN, START):
                return place
            is_fill = held[place + 1] == 0xFF
            place += 1 if is_fill else 2 + int.from_bytes(held[place + 2 : place + 4], "big")
        self._head = place  # what comes next is looked at from there on
        return None

    def _drop_head(self) -> bytes:
        """The head is cut or damaged: the next picture may have begun already."""
        start = self._data.find(START, len(START))
        return self._drop_bytes(start if start >= 0 else len(self._data) - 1)

    def _skip_to_start(self) -> bool:
        start = self._data.find(START)
        if start < 0:
            self._discard_bytes(max(len(self._data) - 1, 0))
            return False
        self._discard_bytes(start)
        return True

    def _limit_held(self) -> bytes | None:
        if len(self._data) <= self._most_bytes:
            return None
        return self._drop_bytes(max(self._data.find(START, len(START)), 0) or len(self._data))

    def _drop_bytes(self, count: int) -> bytes:
        self.dropped += 1
        self._discard_bytes(count)
        return b""

    def _discard_bytes(self, count: int) -> None:
        del self._data[:count]
        self._searched, self._scan, self._head = 0, -1, len(START)
