"""One client's connection: bytes to lines, lines to the dispatcher, and backpressure in both directions.

Requests are taken only while their answers find room, and only so many in a row before others have their
turn; until then the socket is not read. So a client costs at most its buffers and its outbox.
"""

import asyncio
import socket
from collections import Counter
from collections.abc import Callable
from typing import Protocol, cast

from chefbotd.api import jsonrpc
from chefbotd.api.dispatch import Dispatcher
from chefbotd.api.jsonrpc import ErrorKind, Failure
from chefbotd.api.outbox import Outbox
from chefbotd.api.parameters import ApiParameters
from chefbotd.api.session import Session
from chefbotd.clock import Clock


class House(Protocol):
    """What a connection needs from the server that made it."""

    parameters: ApiParameters
    dispatcher: Dispatcher
    drops: Counter[str]
    clock: Clock

    def welcome(self, connection: "Connection") -> bytes:
        """Take the client in; the greeting for it."""
        ...

    def ended(self, session: Session, failure: Failure) -> None:
        """A connection is being ended for this reason."""
        ...

    def farewell(self, connection: "Connection") -> None:
        """The connection is gone."""
        ...


class Connection(asyncio.Protocol):
    """The server's end of one socket."""

    def __init__(self, house: House, session: Session) -> None:
        self._house, self.session = house, session
        self._unread = bytearray()
        self._turn: asyncio.Handle | None = None
        self._outbox: Outbox
        self._transport: asyncio.Transport
        self.reply: Callable[[bytes], None]
        self.telemetry: Callable[[str, bool, bytes], None]

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Asyncio: a client that was admitted is connected; it is greeted."""
        self._transport = cast(asyncio.Transport, transport)  # uvloop's is one in all but its bases
        connected = transport.get_extra_info("socket")
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # The kernel would keep megabytes for a slow client, all of it stale before it is read.
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, self._house.parameters.write_buffer_bytes)
        self._outbox = Outbox(self._transport, self._house.parameters, self._house.drops, self._give_up)
        self.reply, self.telemetry = self._outbox.reply, self._outbox.telemetry
        self.reply(self._house.welcome(self))

    def end(self, failure: Failure) -> None:
        """Send this error, and close."""
        self._house.ended(self.session, failure)
        self.reply(jsonrpc.error(failure))
        self.close()

    def _give_up(self) -> None:
        """The client reads nothing: it would not read an error either."""
        stuck_s = self._house.parameters.stuck_s
        self._house.ended(self.session, Failure(ErrorKind.TIMED_OUT, f"read nothing for {stuck_s:g} s"))
        self.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Asyncio: the client is gone, in good order or not."""
        self._outbox.lost()
        self._unread.clear()
        self._house.farewell(self)

    def data_received(self, data: bytes) -> None:
        """Asyncio: bytes from the client, cut anywhere."""
        self._unread += data
        self.session.heard(self._house.clock.now_s())
        self._take_requests()

    def _take_requests(self) -> None:
        """Serve waiting lines, at most one turn's worth, while their answers find room."""
        self._turn = None
        for _ in range(self._house.parameters.requests_per_turn):
            line = None if self._outbox.blocked or self._outbox.closing else self._next_line()
            if line is None:
                break
            if line:
                self._house.dispatcher.serve(self, line)
            elif not self.session.forgive(self._house.clock.now_s()):
                self.end(Failure(ErrorKind.FLOODING, "empty lines without end"))
        else:
            self._turn = asyncio.get_running_loop().call_soon(self._take_requests)
        self._read_if(self._turn is None and not self._outbox.blocked)

    def _next_line(self) -> bytearray | None:
        """The next line without its end; None when it is not complete, or too long to ever be."""
        end = self._unread.find(b"\n")
        longest = self._house.parameters.max_request_bytes
        if end > longest or (end < 0 and len(self._unread) > longest):
            self.end(Failure(ErrorKind.REQUEST_TOO_LARGE, f"a request has at most {longest} bytes"))
            return None
        self.session.waits_for_line_end(end < 0 and bool(self._unread))
        if end < 0:
            return None
        line = self._unread[:end]
        del self._unread[: end + 1]
        return line.strip()

    def _read_if(self, ready: bool) -> None:
        if self._outbox.closing:
            return
        if ready:
            self._transport.resume_reading()
        else:
            self._transport.pause_reading()

    def pause_writing(self) -> None:
        """Asyncio: the client does not read; neither do we."""
        self._outbox.pause()
        self._read_if(False)

    def resume_writing(self) -> None:
        """Asyncio: the client has read; it gets what waited, then its further requests are taken."""
        self._outbox.resume()
        if self._turn is None:
            self._take_requests()

    def eof_received(self) -> bool:
        """Asyncio: the client has closed its sending side, and so its last line; it gets its answers, and we close."""
        if self._unread:
            self._unread += b"\n"
            self._take_requests()
        self.close()
        return False

    @property
    def closing(self) -> bool:
        """Whether the end has begun."""
        return self._outbox.closing

    def close(self) -> None:
        """Close once the client has what was already on its way."""
        self._outbox.close()

    def abort(self) -> None:
        """Close now."""
        self._transport.abort()
