"""Is a reserved port kept from strangers, and free for whom it is for?"""

import errno
import socket
import struct

import pytest

from chefbotd.transport.ports import reserve_port

IP_LOCAL_PORT_RANGE = 51
"""A socket's own range of ports to be given (linux/in.h, since Linux 6.3)."""


def test_a_reserved_port_is_for_who_asks_for_it_alone() -> None:
    """Nobody listens there at first; who names the port does, twice in turn."""
    port = reserve_port()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port))
    for _ in range(2):
        with socket.create_server(("127.0.0.1", port)), socket.create_connection(("127.0.0.1", port)):
            pass
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", port))


@pytest.mark.parametrize("asks", ["to listen", "to connect"])
def test_a_reserved_port_is_given_to_nobody_who_asks_for_any(asks: str) -> None:
    """Who may be given that port alone is given none; one that was let go is given, unless a stranger was faster."""
    reserved = reserve_port()
    with socket.create_server(("127.0.0.1", 0)) as other:
        assert given(reserved, asks, other) is None
        assert any(given(let_go(), asks, other) for _ in range(20))


def let_go() -> int:
    """A port that was chosen and let go."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port


def given(port: int, asks: str, other: socket.socket) -> int | None:
    """The port that the system gives to a socket which may have this one alone, if it gives it one."""
    with socket.socket() as asking:
        asking.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            asking.setsockopt(socket.IPPROTO_IP, IP_LOCAL_PORT_RANGE, struct.pack("=I", port | port << 16))
        except OSError as error:
            if error.errno != errno.ENOPROTOOPT:
                raise
            pytest.skip("a socket has no range of ports of its own before Linux 6.3")
        try:
            if asks == "to listen":
                asking.bind(("127.0.0.1", 0))
            else:
                asking.connect(other.getsockname())
        except OSError as error:
            if error.errno not in (errno.EADDRINUSE, errno.EADDRNOTAVAIL):
                raise
            return None
        number: int = asking.getsockname()[1]
        return number
