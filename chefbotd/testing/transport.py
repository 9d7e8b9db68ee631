"""A serial device in memory: an asyncio transport without a pty, for tests on a virtual clock."""

import asyncio
from collections.abc import Callable

from chefbotd.link.port import LinkParameters, PortTransport


class FakeSerialTransport(PortTransport):
    """The transport between ``FakeSerialDevice`` and a protocol. It behaves like the serial transport.

    Writes after the link is lost are ignored. While the board does not read, the write buffer fills.
    """

    def __init__(self, protocol: asyncio.Protocol, written: Callable[[bytes], None]) -> None:
        super().__init__()
        self._protocol, self._written = protocol, written
        self._loop = asyncio.get_running_loop()
        self._unsent = bytearray()
        self._high_water = 64 * 1024
        self._stalled = self._paused = self._closing = False
        self.dtr: bool | None = None  # as set after the opening
        self.unread = 0  # bytes that nobody reads, where the reader is stuck
        self._loop.call_soon(protocol.connection_made, self)

    def feed(self, data: bytes) -> None:
        """Bytes arrive from the board, as one chunk."""
        if not self._closing:
            self._protocol.data_received(data)

    def stall(self) -> None:
        """The board stops reading."""
        self._stalled = True

    def drain(self) -> None:
        """The board reads again, starting with what it has missed."""
        self._stalled = False
        unsent = bytes(self._unsent)
        self._unsent.clear()
        if unsent:
            self._written(unsent)
        if self._paused:
            self._paused = False
            self._protocol.resume_writing()

    def lose(self, error: Exception | None = None) -> None:
        """The link is gone."""
        if not self._closing:
            self._closing = True
            self._loop.call_soon(self._protocol.connection_lost, error)

    # asyncio.Transport

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Hand bytes to the board, or to the write buffer while it is stalled."""
        if self._closing:
            return
        if not self._stalled:
            self._written(bytes(data))
            return
        self._unsent += data
        if len(self._unsent) > self._high_water and not self._paused:
            self._paused = True
            self._protocol.pause_writing()

    def unread_bytes(self) -> int:
        """Not known to a device in memory: a test sets it."""
        return self.unread

    def overtake(self, words: bytes) -> None:
        """Replace all unsent bytes by these."""
        self._unsent.clear()
        self.write(words)

    def close_behind(self, words: bytes, *, dtr: bool) -> None:
        """Set or clear the line; a stalled board may still read the words."""
        self.dtr = dtr
        super().close_behind(words, dtr=dtr)

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        """Pause the protocol when more than ``high`` bytes are unsent."""
        self._high_water = 64 * 1024 if high is None else high

    def get_write_buffer_size(self) -> int:
        """Bytes the board has not read yet."""
        return len(self._unsent)

    def is_closing(self) -> bool:
        """Whether the link is lost or given up."""
        return self._closing

    def close(self) -> None:
        """Give the port up."""
        self.lose()

    def abort(self) -> None:
        """Give the port up."""
        self.lose()


class FakeSerialDevice:
    """A device that can be plugged, unplugged, fed and listened to. Give its ``open`` to ``PortLink`` as the opener."""

    def __init__(self, *, plugged: bool = True) -> None:
        self.plugged = plugged
        self.written = bytearray()
        self.on_write: Callable[[bytes], None] = self.written.extend
        self.transport: FakeSerialTransport | None = None

    async def open(self, parameters: LinkParameters, protocol: asyncio.BaseProtocol) -> asyncio.Transport:
        """Connect a protocol; raises ``FileNotFoundError`` while unplugged, as a path without a device does."""
        if not self.plugged:
            raise FileNotFoundError(f"could not open port {parameters.device}: no such device")
        if not isinstance(protocol, asyncio.Protocol):
            raise TypeError(f"expected an asyncio.Protocol, got {protocol!r}")
        self.transport = FakeSerialTransport(protocol, lambda data: self.on_write(data))
        return self.transport

    def feed(self, data: bytes) -> None:
        """Bytes from the board; lost when nobody has the device open."""
        if self.transport is not None:
            self.transport.feed(data)

    def unplug(self) -> None:
        """Pull the cable."""
        self.plugged = False
        if self.transport is not None:
            self.transport.lose(OSError("device reports readiness to read but returned no data"))
            self.transport = None

    def plug(self) -> None:
        """Put the cable back."""
        self.plugged = True
