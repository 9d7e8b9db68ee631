"""Which sockets hold bytes that nobody has read yet."""

import fcntl
import select
import socket
import termios
from typing import Protocol

from chefbotd.rpc.arrivals import Arrival
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
