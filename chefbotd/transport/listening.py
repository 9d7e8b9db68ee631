"""Listening sockets, and the number of file descriptors that are left for clients."""

import errno
import os
import resource
import socket

from chefbotd.rpc.connection_manager import Headroom

BACKLOG = 128
RESERVED_DESCRIPTORS = 32
"""Left for the serial link to reopen its device, for the places kept for stops, and for all that is no client."""
CLOSING_DESCRIPTORS = 8
"""Left for new clients until those that were disconnected for them have closed their own."""


class CannotListen(OSError):
    """An address that cannot be listened on; its text is ready to be shown."""

    def __str__(self) -> str:
        return str(self.strerror)


class DescriptorLimit:
    """How many file descriptors are left for clients, by the number of a new one: it is the lowest that is free."""

    def __init__(self, reserved_stop_connections: int) -> None:
        self._low = resource.getrlimit(resource.RLIMIT_NOFILE)[0] - RESERVED_DESCRIPTORS
        self._none = self._low + reserved_stop_connections + CLOSING_DESCRIPTORS

    def headroom(self, descriptor: int) -> Headroom:
        """What a client with this descriptor finds."""
        if descriptor >= self._none:
            return Headroom.NONE
        return Headroom.LOW if descriptor >= self._low else Headroom.ENOUGH


def listen(host: str, port: int, receive_bytes: int, option: str) -> list[socket.socket]:
    """Listen on every address of a host, which is looked up while nothing runs yet.

    ``receive_bytes`` bounds what the kernel holds for each client; ``option`` chooses another port, for the message.

    Raises:
        CannotListen: one of them cannot be listened on, or there is no such host.
    """
    listeners: list[socket.socket] = []
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        for family, _, _, _, address in dict.fromkeys(addresses):
            listener = socket.create_server(address, family=family, backlog=BACKLOG)
            listeners.append(listener)
            # Accepted sockets inherit this bound on the requests that the kernel holds.
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
            listener.setblocking(False)
    except OSError as error:
        for listener in listeners:
            listener.close()
        number = error.errno or 0  # a look-up's are negative; a socket's own text repeats the address
        why = (os.strerror(number) if number > 0 else str(error.strerror)).lower()
        if number == errno.EADDRINUSE:
            why += f"; is another chefbotd running? {option} chooses another port"
        raise CannotListen(error.errno, f"cannot listen on {host}:{port}: {why}") from error
    return listeners
