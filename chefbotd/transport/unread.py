"""Which sockets hold bytes that nobody has read yet, how old those can be, and which stops are in them."""

import fcntl
import select
import socket
import termios
from collections.abc import Callable
from typing import Protocol

from chefbotd.core.record import replace
from chefbotd.rpc.arrivals import Arrivals, ByteArrival
from chefbotd.rpc.backlog import Backlog
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.jsonrpc import ErrorKind, Failure, Request
from chefbotd.rpc.session import Session

# Finds stops in a client's waiting bytes, before other requests and when its connection ends, within limits.
#
# Bytes are counted, and lines that look like a stop. No client that means to stop the robot sends so many.

DRAIN_S = 0.2
"""For how long a connection that ends is still read; what the kernel holds is there at once."""
DRAIN_BYTES = 524_288
"""More than the kernel (twice ``backlog_bytes`` and a segment) and TLS (256 KiB) can hold."""
DRAIN_LINES = 1000


class DrainLimit:
    """``exceeded`` once too much was read, or when the draining is to end early."""

    def __init__(self) -> None:
        self._bytes, self._lines, self._served = DRAIN_BYTES, DRAIN_LINES, set[str]()
        self.exceeded = False

    def count_bytes(self, size: int) -> None:
        """Count bytes that were read; a method that was served before may be served once more."""
        self._bytes -= size
        self._served.clear()
        self.exceeded = self.exceeded or self._bytes < 0

    def admit_line(self, method: str | None) -> bool:
        """Whether to serve a line that asks for an urgent method; None: it only looked like one.

        Of several lines with the same method that arrived together, one is enough.
        """
        self._lines -= 1
        self.exceeded = self.exceeded or self._lines < 0
        if self.exceeded or method is None or method in self._served:
            return False
        self._served.add(method)
        return True


class StopSearch:
    """Finds urgent requests in one client's backlog, and has ``serve`` carry them out.

    ``closing`` says whether the connection ends; then what was searched is dropped, within ``limit``.
    ``first_line_served``: a line was, and it was of no other protocol.
    """

    def __init__(
        self,
        session: Session,
        backlog: Backlog,
        dispatcher: Dispatcher,
        serve: Callable[[Request], None],
        closing: Callable[[], bool],
    ) -> None:
        self._session, self._backlog, self._dispatcher = session, backlog, dispatcher
        self._serve, self._closing = serve, closing
        self.limit = DrainLimit()
        self.first_line_served = False

    def serve_next(self) -> bool:
        """Serve the next urgent request; whether there may be more. Who has no role has to send a token first."""
        if self._session.role is None and not self._closing():
            return False
        if self._closing() and not self.first_line_served:
            self._check_first_line()
        line = self._backlog.find_urgent()
        if line is not None:
            self._serve_if_urgent(line)
        if self._closing():
            self._backlog.drop_searched()
        return line is not None

    def _check_first_line(self) -> None:
        """Do not search a connection that began with another protocol."""
        foreign = self._dispatcher.is_foreign(self._backlog.first_line())
        self.limit.exceeded |= foreign or self._backlog.too_long
        self.first_line_served = bool(self._backlog) and not self._backlog.unfinished

    def _serve_if_urgent(self, line: bytearray) -> None:
        request = self._dispatcher.urgent_request(self._session, line)
        if request is not None:
            self._backlog.remove_found()
        if self._closing() and not self.limit.admit_line(None if request is None else request.method):
            return
        if request is not None:
            self._serve(request)

    def is_untrusted(self, failure: Failure) -> bool:
        """Whether a client that is ended for this may not stop the robot either: a web page, or one without a token."""
        kind = failure.kind
        foreign = kind in (ErrorKind.PARSE_ERROR, ErrorKind.NOT_UTF8)
        endless = kind is ErrorKind.REQUEST_TOO_LARGE and not self.first_line_served
        return foreign or endless or (kind is ErrorKind.WRONG_TOKEN and self._session.role is None)


class SocketReader(Protocol):
    """Reads one socket."""

    def mark_unread(self, arrival: ByteArrival) -> None:
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

    def mark(self, arrival: ByteArrival, client: object) -> None:
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

    def __init__(self, arrivals: Arrivals, unread_since: ByteArrival | None) -> None:
        self._arrivals, self.unread_since = arrivals, unread_since
        self._partial_since: ByteArrival | None = None

    def mark_unread(self, arrival: ByteArrival) -> None:
        """What the kernel holds may have arrived as early as this."""
        self.unread_since = self.unread_since or arrival

    def arrival_of(self, lines: bytes, *, partial: bool) -> ByteArrival:
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


def _after_stop(arrival: ByteArrival | None, before: int, now: int) -> ByteArrival | None:
    return replace(arrival, stops=now) if arrival is not None and arrival.stops == before else arrival
