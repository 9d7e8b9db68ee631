"""Which clients have sent bytes that nobody has read yet when a stop is carried out."""

import socket

from chefbotd.rpc.arrivals import ByteArrival
from chefbotd.transport.unread import UnreadSockets, unread_bytes

BEFORE = ByteArrival(7.0, 3)


class Reader:
    """Remembers what it is told."""

    def __init__(self) -> None:
        self.marked: list[ByteArrival] = []

    def mark_unread(self, arrival: ByteArrival) -> None:
        """Remember it."""
        self.marked.append(arrival)


def test_bytes_in_the_kernel_are_marked_but_for_the_stops_own_client() -> None:
    """Of three sockets with bytes in the kernel and one without, two hear of the stop of the third."""
    unread, readers = UnreadSockets(), [Reader() for _ in range(4)]
    pairs = [socket.socketpair() for _ in readers]
    for reader, (near, far) in zip(readers, pairs, strict=True):
        unread.register(near.fileno(), reader)
        if reader is not readers[3]:
            far.send(b"12345")
    assert [unread_bytes(near.fileno()) for near, _ in pairs] == [5, 5, 5, 0]
    unread.mark(BEFORE, readers[1])
    assert [reader.marked for reader in readers] == [[BEFORE], [], [BEFORE], []]
    for reader, (near, far) in zip(readers, pairs, strict=True):
        unread.unregister(near.fileno(), reader)
        near.close()
        far.close()
    unread.mark(BEFORE, None)
    assert [len(reader.marked) for reader in readers] == [1, 0, 1, 0]


def test_a_closed_socket_holds_nothing_and_is_not_marked() -> None:
    """Its descriptor is -1, or is not open any more."""
    unread, reader = UnreadSockets(), Reader()
    near, far = socket.socketpair()
    number = near.fileno()
    near.close()
    far.close()
    unread.register(near.fileno(), reader)
    unread.mark(BEFORE, None)
    assert (reader.marked, unread_bytes(near.fileno()), unread_bytes(number)) == ([], 0, 0)
