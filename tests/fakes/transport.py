"""A client's socket in memory, whose reader can be told to stop: no kernel buffers, no real time."""

import asyncio
from collections.abc import Callable
from typing import Any


class FakeSocket:
    """Takes socket options."""

    def __init__(self) -> None:
        self.options: dict[tuple[int, int], int] = {}

    def fileno(self) -> int:
        """There is none."""
        return -1

    def setsockopt(self, level: int, option: int, value: int) -> None:
        """Remember it."""
        self.options[level, option] = value


class FakeTransport(asyncio.Transport):
    """Keeps what is written; once ``high`` bytes are unread it pauses its writer, as asyncio's transports do."""

    def __init__(self) -> None:
        self.socket = FakeSocket()
        super().__init__({"socket": self.socket})
        self.pause_writing: Callable[[], Any]
        self.resume_writing: Callable[[], Any]
        self.written: list[bytes] = []
        self.client_reads = True
        self.is_read = True
        self.unread_bytes = 0
        self.closed = self.aborted = False
        self._paused = False
        self._high, self._low = 65536, 16384

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        """Take the limits."""
        self._high, self._low = high or 0, low or 0

    def get_write_buffer_size(self) -> int:
        """What the client has not read yet."""
        return self.unread_bytes

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Keep it, and pause the writer when that is too much."""
        self.written.append(bytes(data))
        self.unread_bytes += 0 if self.client_reads else len(data)
        if self.unread_bytes > self._high and not self._paused:
            self._paused = True
            self.pause_writing()

    def client_takes(self, size: int) -> None:
        """The client reads so many bytes after all."""
        self.unread_bytes -= min(size, self.unread_bytes)
        if self._paused and self.unread_bytes <= self._low:
            self._paused = False
            self.resume_writing()

    def pause_reading(self) -> None:
        """Our side takes no more requests."""
        self.is_read = False

    def resume_reading(self) -> None:
        """Our side takes requests again."""
        self.is_read = True

    def close(self) -> None:
        """Remember it."""
        self.closed = True

    def abort(self) -> None:
        """Remember it."""
        self.aborted = True
