"""Which sockets hold bytes that nobody has read yet, and how old they can be."""

import fcntl
import select
import socket
import termios
from typing import Protocol

from chefbotd.core.record import replace
from chefbotd.rpc.arrivals import Arrival, Arrivals
from chefbotd.rpc.drain import DRAIN_BYTES


class SocketReader(Protocol):
    """Reads one socket."""

    def mark_unread(self, arrival: Arrival) -> None:
        """What the kernel holds of this socket now may have arrived as early as this."""
        ...


class UnreadSockets:
    """Every socket that is read, by descriptor."""

    def __init__(self) -> None:
        self._readers: dict[int, SocketReader] = {}
        self._poll = select.poll()

    def register(self, descriptor: int, reader: SocketReader) -> None:
        """Tell this reader of stops from now on; a socket that is closed already has the descriptor -1."""
        if descriptor < 0:
            return
        self._readers[descriptor] = reader
        self._poll.register(descriptor, select.POLLIN)

    def unregister(self, descriptor: int, reader: SocketReader) -> None:
        """Do so no longer; another socket may have the descriptor by now."""
        if self._readers.get(descriptor) is reader:
            del self._readers[descriptor]
            self._poll.unregister(descriptor)

    def mark(self, arrival: Arrival, client: object) -> None:
        """Mark what is unread on every socket except this client's."""
        for descriptor, _ in self._poll.poll(0):
            if self._readers[descriptor] is not client:
                self._readers[descriptor].mark_unread(arrival)


def unread_bytes(descriptor: int) -> int:
    """How many bytes the kernel holds for a socket; 0 for a closed one."""
    if descriptor < 0:
        return 0
    try:
        return int.from_bytes(fcntl.ioctl(descriptor, termios.FIONREAD, bytes(4)), "little")
    except OSError:
        return 0


def kernel_bytes(plain: socket.socket | None) -> bytes:
    """What the kernel holds, on Linux even after a reset; nothing through TLS (None)."""
    try:
        return b"" if plain is None else plain.recv(DRAIN_BYTES)
    except OSError:  # it holds nothing, or is closed
        return b""


class HeldBytes:
    """``unread_since`` is the earliest arrival of what the kernel holds; None: it holds nothing."""

    def __init__(self, arrivals: Arrivals, unread_since: Arrival | None) -> None:
        self._arrivals, self.unread_since = arrivals, unread_since
        self._partial_since: Arrival | None = None

    def mark_unread(self, arrival: Arrival) -> None:
        """What the kernel holds may have arrived as early as this."""
        self.unread_since = self.unread_since or arrival

    def arrival_of(self, lines: bytes, *, partial: bool) -> Arrival:
        """The arrival of the lines that were just read. The first of them is as old as its first byte.

        ``partial``: a request has begun, and not ended.
        """
        arrival = self.unread_since or self._arrivals.earliest()
        first = self._partial_since or arrival
        if not partial:
            self._partial_since = None
        elif lines or self._partial_since is None:
            self._partial_since = arrival
        return first

    def record_own_stop(self, before: int, now: int) -> None:
        """The client's own stop, number ``now`` after ``before``, was carried out: what it holds was sent after it."""
        self.unread_since = _after_stop(self.unread_since, before, now)
        self._partial_since = _after_stop(self._partial_since, before, now)


def _after_stop(arrival: Arrival | None, before: int, now: int) -> Arrival | None:
    return replace(arrival, stops=now) if arrival is not None and arrival.stops == before else arrival
