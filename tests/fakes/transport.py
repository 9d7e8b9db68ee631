"""A client's socket whose reader can be told to stop."""

import asyncio

from chefbotd.api.outbox import Outbox


class FakeTransport(asyncio.Transport):
    """Keeps what is written; once ``high`` bytes are unread it pauses its writer, as asyncio's transports do."""

    def __init__(self) -> None:
        super().__init__()
        self.writer: Outbox
        self.written: list[bytes] = []
        self.reading = True
        self.unread_bytes = 0
        self.closed = self.aborted = False
        self._paused = False

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        """Take the limits."""
        self._high, self._low = high or 0, low or 0

    def get_write_buffer_size(self) -> int:
        """What the client has not read yet."""
        return self.unread_bytes

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Keep it, and pause the writer when that is too much."""
        self.written.append(bytes(data))
        self.unread_bytes += 0 if self.reading else len(data)
        if self.unread_bytes > self._high and not self._paused:
            self._paused = True
            self.writer.pause()

    def read(self, size: int) -> None:
        """The client reads so many bytes after all."""
        self.unread_bytes -= min(size, self.unread_bytes)
        if self._paused and self.unread_bytes <= self._low:
            self._paused = False
            self.writer.resume()

    def close(self) -> None:
        """Remember it."""
        self.closed = True

    def abort(self) -> None:
        """Remember it."""
        self.aborted = True
