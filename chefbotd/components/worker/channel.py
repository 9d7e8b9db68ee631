"""The daemon's end of the socket to the worker. It never waits and never grows.

What is to be sent is queued, and written when the present turn of the loop is over, so that no control step pays for
it. Where the worker does not read, the oldest of what was measured gives way and is counted.
"""

import asyncio
import socket
from collections import deque
from collections.abc import Callable
from typing import Final

from chefbotd.components.worker.messages import (
    FROM_WORKER,
    MOST_BYTES,
    FrameReader,
    FromWorker,
    Measured,
    NotAMessage,
    ToWorker,
    decode_message,
    frame_message,
)
from chefbotd.core.sentence import Sentence

READ_BYTES: Final = 1 << 15
"""At most so much is read in one turn of the loop."""

KERNEL_BYTES: Final = 1 << 15
"""What the kernel may hold of unread messages: a few scans. What lies there can no longer give way."""

CLOSED: Final = Sentence("worker.closed", "it closed its socket")


class Channel:
    """A connected socket; ``on_end`` is called once, with the reason, when nothing can be said or heard any more."""

    def __init__(
        self,
        ours: socket.socket,
        most_bytes: int,
        on_message: Callable[[FromWorker], None],
        on_end: Callable[[str], None],
    ) -> None:
        ours.setblocking(False)
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, KERNEL_BYTES)
        self._socket, self._most_bytes = ours, most_bytes
        self._on_message, self._on_end = on_message, on_end
        self._loop = asyncio.get_running_loop()
        self._reader = FrameReader()
        self._queue: deque[tuple[bytes, bool]] = deque()
        self._queued_bytes = self._spare_bytes = 0  # of all messages, and of those that may give way
        self._partly_sent = b""
        self._scheduled = self._writing = self._closed = False
        self.dropped = 0
        self._loop.add_reader(ours, self._readable)

    def send(self, message: ToWorker) -> None:
        """Queue a message; where there is no room the oldest that may give way do."""
        if self._closed:
            return
        frame, gives_way = frame_message(message), isinstance(message, Measured)
        self._queue.append((frame, gives_way))
        self._count(frame, gives_way, 1)
        if self._spare_bytes > self._most_bytes:
            self._make_room()
        if self._queued_bytes > MOST_BYTES + self._most_bytes:
            self._end_channel(Sentence("worker.does_not_read", "it does not read what it is asked"))
            return
        if not self._scheduled and not self._writing:
            self._scheduled = True
            self._loop.call_soon(self._write)

    def close(self) -> None:
        """Close the socket; the worker takes this for the end."""
        if self._closed:
            return
        self._closed = True
        self._loop.remove_reader(self._socket)
        if self._writing:
            self._loop.remove_writer(self._socket)
        self._socket.close()

    def _count(self, frame: bytes, gives_way: bool, sign: int) -> None:
        self._queued_bytes += sign * len(frame)
        self._spare_bytes += sign * len(frame) if gives_way else 0

    def _make_room(self) -> None:
        """Drop the oldest messages that may give way, until the others of them fit."""
        kept: deque[tuple[bytes, bool]] = deque()
        for frame, gives_way in self._queue:
            if gives_way and self._spare_bytes > self._most_bytes:
                self._count(frame, gives_way, -1)
                self.dropped += 1
            else:
                kept.append((frame, gives_way))
        self._queue = kept

    def _write(self) -> None:
        self._scheduled = False
        if self._closed:
            return
        try:
            while self._partly_sent or self._queue:
                if not self._partly_sent:
                    frame, gives_way = self._queue.popleft()
                    self._count(frame, gives_way, -1)
                    self._partly_sent = frame
                sent = self._socket.send(self._partly_sent)
                self._partly_sent = self._partly_sent[sent:]
        except BlockingIOError:
            if not self._writing:
                self._writing = True
                self._loop.add_writer(self._socket, self._write)
            return
        except OSError:
            self._end_channel(CLOSED)
            return
        if self._writing:
            self._writing = False
            self._loop.remove_writer(self._socket)

    def _readable(self) -> None:
        try:
            data = self._socket.recv(READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            self._end_channel(CLOSED)
            return
        if not data:
            self._end_channel(CLOSED)
            return
        try:
            for frame in self._reader.feed(data):
                self._on_message(decode_message(FROM_WORKER, frame))
                if self._closed:
                    return
        except NotAMessage as garbage:
            self._end_channel(Sentence("worker.no_message", "it sent what is no message: {why}", why=garbage))

    def _end_channel(self, reason: str) -> None:
        if not self._closed:
            self.close()
            self._on_end(reason)
