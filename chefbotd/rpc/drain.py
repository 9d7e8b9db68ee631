"""Finds stops in a client's waiting bytes, before other requests and when its connection ends, within limits.

Bytes are counted, and lines that look like a stop. No client that means to stop the robot sends so many.
"""

from collections.abc import Callable

from chefbotd.rpc.backlog import Backlog
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.jsonrpc import ErrorKind, Failure, Request
from chefbotd.rpc.session import Session

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
        """Do not drain what begins with another protocol, whatever the connection ends for."""
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
