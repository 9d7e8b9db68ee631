"""One client's connection, over TCP or a WebSocket: has its requests served, and limits both directions.

Requests are served in order, when their answers find room, and when the scheduler gives this client its share. Stops
do not wait for that. A client that has to wait is still read, within a limit, and what was read is searched for stops.
When a connection ends, for whatever reason, what has arrived by then is searched once more. So a client costs at most
its buffers and its outbox, and no stop that has reached the socket is lost.
"""

import asyncio
import socket
from collections.abc import Callable
from typing import cast

from chefbotd.rpc.arrivals import ByteArrival
from chefbotd.rpc.backlog import Backlog
from chefbotd.rpc.connection_manager import ConnectionManager
from chefbotd.rpc.jsonrpc import ErrorKind, Failure, Request
from chefbotd.rpc.method import EventSink
from chefbotd.rpc.session import Session
from chefbotd.transport.framing import ConnectionFraming, LineFraming
from chefbotd.transport.outbox import Outbox
from chefbotd.transport.state import NEXT, READING, SERVING, ConnectionEvent, ConnectionState
from chefbotd.transport.unread import (
    DRAIN_S,
    HeldBytes,
    StopSearch,
    UnreadSockets,
    kernel_bytes,
    unread_bytes,
)


class SocketConnection(asyncio.Protocol):
    """The server's end of one socket; ``plain`` is that socket, where what it holds is not encrypted.

    ``framing`` finds the requests in its bytes; without one, each is a line.
    """

    def __init__(
        self,
        manager: ConnectionManager,
        unread: UnreadSockets,
        session: Session,
        plain: socket.socket | None = None,
        framing: ConnectionFraming | None = None,
    ) -> None:
        self._framing: ConnectionFraming = framing or LineFraming()
        self._manager, self._unread, self.session, self._plain = manager, unread, session, plain
        self._backlog = Backlog(manager.parameters.max_request_bytes, manager.dispatcher.urgent_pattern)
        self._state = ConnectionState.OPEN
        self._scheduled = False
        self._may_hold_stops = False  # the backlog, beyond what was searched
        self._descriptor = -1
        self._paused = False
        self._held = HeldBytes(manager.arrivals, session.arrival)
        self._search = StopSearch(
            session, self._backlog, manager.dispatcher, self._serve_urgent_request, lambda: self.closing
        )
        self._drain_timer: asyncio.TimerHandle | None = None
        self._finish: Callable[[], None] = self.close  # once everything was served
        self._outbox: Outbox
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Asyncio: an admitted client is connected; it is greeted."""
        self._transport = cast(asyncio.Transport, transport)  # uvloop's is one in all but its bases
        connected = transport.get_extra_info("socket")
        self._descriptor = connected.fileno()
        self._unread.register(self._descriptor, self)
        asyncio.get_running_loop().call_soon(self._clear_unread_mark)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # The kernel would keep megabytes for a slow client, all of it stale before it is read.
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, self._manager.parameters.write_buffer_bytes)
        self._outbox = Outbox(
            self._transport,
            self._manager.parameters,
            self._manager.drops,
            self._end_stuck,
            self._framing.encode,
            self._framing.event,
            self._framing.describe_drops,
            self._plain,
        )
        greeting = self._manager.add(self)
        if greeting:
            self.reply(greeting)

    def reply(self, message: bytes, *, keep: bool = False) -> None:
        """Send an answer; never waits. ``keep``: even if the client reads too little and the answer has no room."""
        self._outbox.reply(self._framing.encode(message), keep=keep)

    def send_progress(self, message: bytes) -> None:
        """Send a progress notification, or keep the latest while the client is behind; never waits."""
        self._outbox.telemetry("progress", True, self._framing.encode(message))

    @property
    def send_event(self) -> EventSink:
        """Sends an event, or keeps it by the policy while the client is behind; never waits."""
        return self._outbox.write_event

    def data_received(self, data: bytes) -> None:
        """Asyncio: bytes from the client, cut anywhere."""
        if self._state not in READING:
            return
        self.session.record_activity(self._manager.clock.now_s())
        self._add_requests(data)
        self._clear_unread_mark()
        if self.closing:
            self._search.limit.count_bytes(len(data))
        self._serve_waiting()
        if self._framing.failure is not None and not self.closing:
            self.end(self._framing.failure, at_once=True)
        elif self._framing.ended and self._state in READING:
            self._read_no_more(ConnectionEvent.EOF)

    def _add_requests(self, data: bytes) -> None:
        """Put the requests in these bytes into the backlog; a request is as old as its first byte."""
        lines = self._framing.lines(data)
        self._backlog.add(lines, self._held.arrival_of(lines, partial=self._framing.partial))
        control = self._framing.control()
        if control:
            self._outbox.reply(control)

    def mark_unread(self, arrival: ByteArrival) -> None:
        """What the kernel holds of this client may have arrived as early as this."""
        self._held.mark_unread(arrival)

    def _clear_unread_mark(self) -> None:
        """Once the kernel holds nothing, what comes next is new."""
        if self._held.unread_since is not None and not self._paused and not unread_bytes(self._descriptor):
            self._held.unread_since = None

    def _serve_waiting(self) -> None:
        """Serve what this loop iteration has room for, then search the rest for stops; schedule what is left."""
        if self._scheduled and self._may_hold_stops:
            return
        scheduler, more = self._manager.scheduler, True
        while more and not self._scheduled and scheduler.try_acquire():
            more = self._serve_next()
        self._may_hold_stops = self._serve_urgent()
        while self._may_hold_stops and not self._scheduled and scheduler.try_acquire():
            self._may_hold_stops = self._serve_urgent()
        self._schedule_rest(more)

    def run_scheduled(self) -> None:
        """Serve the next request, and the next one of the stops among the others."""
        self._scheduled = False
        more = self._serve_next()
        self._may_hold_stops = self._serve_urgent()
        self._schedule_rest(more)

    def _schedule_rest(self, more: bool) -> None:
        if self._may_hold_stops or more:
            self._schedule()
        elif not self._backlog and self._state not in READING:
            ends_here = self._state in (ConnectionState.HALF_CLOSED, ConnectionState.DRAINED)
            self._enter(ConnectionEvent.SERVED)
            if ends_here:
                self._finish()
            if self._state is ConnectionState.CLOSED:
                self.finish()
        self.session.set_incomplete(self._backlog.unfinished or self._framing.partial)
        self._limit_reading()

    def finish(self) -> None:
        """Nothing of it is left to be served."""

    def _schedule(self) -> None:
        if not self._scheduled:
            self._scheduled = True
            self._manager.scheduler.add(self)

    def _serve_next(self) -> bool:
        """Serve the next request, if there is room for its answer; whether there may be another one."""
        if self._state not in SERVING:
            return False
        if self._backlog.too_long:
            longest = self._manager.parameters.max_request_bytes
            self.end(Failure(ErrorKind.REQUEST_TOO_LARGE, f"a request has at most {longest} bytes"))
            return False
        line = None if self._outbox.blocked else self._backlog.take_line()
        if line is None:
            return False
        self.session.set_incomplete(False)
        dispatcher, arrivals = self._manager.dispatcher, self._manager.arrivals
        if line.text or dispatcher.sheds:
            before = arrivals.stops
            dispatcher.serve(self, line.text, line.arrival)
            if arrivals.stops != before:
                self._note_own_stop(before)
        elif not self.session.admit_error(self._manager.clock.now_s()):
            self.end(Failure(ErrorKind.FLOODING, "empty lines without end"))
        self._search.first_line_served = True
        return bool(self._backlog)

    def _note_own_stop(self, before: int) -> None:
        """The request that was served was a stop, after ``before`` others: what is behind it was sent after it."""
        stops = self._manager.arrivals.stops
        self._backlog.record_own_stop(before, stops)
        self._held.record_own_stop(before, stops)

    def _serve_urgent(self) -> bool:
        """Serve the next urgent request, before or, when draining, instead of others; whether there may be more."""
        if self._state is ConnectionState.OPEN and not self._backlog:
            return False
        more = self._search.serve_next()
        if self._search.limit.exceeded:
            self._backlog.clear()
            self._enter(ConnectionEvent.DRAIN_OVER)
        return more

    def _serve_urgent_request(self, request: Request) -> None:
        before = self._manager.arrivals.stops
        self._manager.dispatcher.serve_request(self, request)
        if self._manager.arrivals.stops != before:
            self._note_own_stop(before)

    def _limit_reading(self) -> None:
        """Pause reading while the backlog is full, or may hold stops: more bytes would only come after them."""
        if self._state not in READING:
            return
        full = self._is_full()
        if full and self._manager.dispatcher.sheds and not self._may_hold_stops:
            self._manager.dispatcher.shed(self, self._backlog.take_searched())
            full = self._is_full()
        if full and self._outbox.blocked:
            self._outbox.shorten_timeout()
        if full or self._may_hold_stops:
            if not self._paused:
                self._paused = True
                self._held.mark_unread(self._manager.arrivals.earliest())
            self._transport.pause_reading()
        else:
            self._paused = False
            self._clear_unread_mark()
            self._transport.resume_reading()

    def _is_full(self) -> bool:
        return len(self._backlog) > self._manager.parameters.backlog_bytes

    def pause_writing(self) -> None:
        """Asyncio: the client does not read; only stops are served now."""
        self._outbox.hold_back()

    def resume_writing(self) -> None:
        """Asyncio: the client has read; it gets what waited, then its further requests are served."""
        self._outbox.resume()
        self._serve_waiting()

    def eof_received(self) -> bool:
        """Asyncio: the client sends no more, so its last line has ended; it gets its answers, and we close."""
        self._read_no_more(ConnectionEvent.EOF)
        return (
            self._state is not ConnectionState.CLOSED and self._plain is not None
        )  # TLS cannot be half-closed

    def _read_no_more(self, event: ConnectionEvent) -> None:
        self._enter(event)
        self._backlog.finish()
        self._serve_waiting()

    def connection_lost(self, exc: Exception | None) -> None:
        """Asyncio: the socket is gone. Search the received bytes for stops."""
        self._outbox.lost()
        if self._drain_timer is not None:
            self._drain_timer.cancel()
        if self._state in READING:
            self._add_requests(kernel_bytes(self._plain))
        self._unread.unregister(self._descriptor, self)
        self._manager.remove(self.session)
        self._enter(ConnectionEvent.LOST)
        self._backlog.finish()
        self._schedule()

    def _end_stuck(self) -> None:
        """The client reads nothing: it would not read an error either."""
        if self._state is not ConnectionState.CLOSED and self.closing:
            return  # it is being drained; from the end of that it has its time to read
        why = f"read nothing for {self._outbox.timeout_s:g} s"
        self._manager.count_ended(self.session, Failure(ErrorKind.TIMED_OUT, why))
        if self.closing:
            self.abort()
        else:
            self._drain(self.abort)

    def end(self, failure: Failure, *, at_once: bool = False) -> None:
        """Send this error, serve the stops that have arrived, or arrive while the connection is drained, and close."""
        if self.closing:  # a request that was served while draining is another reason to end
            self._search.limit.exceeded = True
            return
        self._manager.count_ended(self.session, failure)
        self.reply(self._framing.describe_failure(failure))
        if self._search.is_untrusted(failure):
            self.close()
        else:
            self._drain(self.close, at_once)

    def _drain(self, finish: Callable[[], None], at_once: bool = False) -> None:
        self._outbox.shut()
        self._finish = finish
        self._enter(ConnectionEvent.END)
        if at_once:
            self._add_requests(kernel_bytes(self._plain))
            self._read_no_more(ConnectionEvent.DRAIN_OVER)
        else:
            loop = asyncio.get_running_loop()
            self._drain_timer = loop.call_later(DRAIN_S, self._read_no_more, ConnectionEvent.DRAIN_OVER)
            self._schedule()

    def _enter(self, event: ConnectionEvent) -> None:
        self._state = NEXT[self._state, event]

    @property
    def closing(self) -> bool:
        """Whether requests are no longer served in order, because the connection ends."""
        return self._state not in SERVING

    def close(self) -> None:
        """Close once the client has what was already on its way; nothing it sends is read any more."""
        self._enter(ConnectionEvent.CLOSE)
        self._backlog.clear()
        self._outbox.close(self._framing.goodbye())

    def abort(self) -> None:
        """Close now. Nothing follows what the transport throws away."""
        self._enter(ConnectionEvent.CLOSE)
        self._outbox.shut()
        self._transport.abort()
