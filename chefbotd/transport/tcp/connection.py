"""One client's connection: bytes to lines, lines to the dispatcher, and backpressure in both directions.

Requests are served in order, while their answers find room, and when it is their turn among those of all clients.
Stops do not wait for that: a client that has to wait is read on, within a bound, and what has been read is looked
through for them. When a connection ends, whatever ends it, what has come by then is looked through once more. So a
client costs at most its buffers and its outbox, and no stop that has reached the socket is lost.
"""

import asyncio
import socket
from collections.abc import Callable
from functools import lru_cache
from typing import cast

from chefbotd.rpc import jsonrpc
from chefbotd.rpc.arrivals import Arrival
from chefbotd.rpc.backlog import Backlog
from chefbotd.rpc.connection_manager import ConnectionManager
from chefbotd.rpc.event import EventPayload
from chefbotd.rpc.jsonrpc import ErrorKind, Failure
from chefbotd.rpc.last_look import LAST_LOOK_BYTES, LAST_LOOK_S, LastLook
from chefbotd.rpc.session import Session
from chefbotd.transport.tcp.outbox import Outbox
from chefbotd.transport.tcp.unread import UnreadSockets, unread_bytes


class Connection(asyncio.Protocol):
    """The server's end of one socket; ``plain`` is that socket, where what it holds is not encrypted."""

    def __init__(
        self,
        manager: ConnectionManager,
        unread: UnreadSockets,
        session: Session,
        plain: socket.socket | None = None,
    ) -> None:
        self._manager, self._unread, self.session, self._plain = manager, unread, session, plain
        self._backlog = Backlog(manager.parameters.max_request_bytes, manager.dispatcher.hint)
        self._waits = False  # for its turn
        self._looks = False  # when it has its turn, for there may be more stops
        self._is_ours = False  # its first line was no other protocol's
        self._hears = True
        self._descriptor = -1
        self._paused = False
        self._unread_since = session.arrival  # the earliest at which what the kernel holds can have come
        self._at_last: Callable[[], None] | None = (
            None  # once nothing more is heard, and all has been seen to
        )
        self._last_look = LastLook()
        self._last_look_ends: asyncio.TimerHandle | None = None
        self._outbox: Outbox
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Asyncio: a client that was admitted is connected; it is greeted."""
        self._transport = cast(asyncio.Transport, transport)  # uvloop's is one in all but its bases
        connected = transport.get_extra_info("socket")
        self._descriptor = connected.fileno()
        self._unread.register(self._descriptor, self)
        asyncio.get_running_loop().call_soon(self._forget_what_was_read)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # The kernel would keep megabytes for a slow client, all of it stale before it is read.
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, self._manager.parameters.write_buffer_bytes)
        self._outbox = Outbox(self._transport, self._manager.parameters, self._manager.drops, self._give_up)
        self.reply(self._manager.add(self))

    def reply(self, message: bytes) -> None:
        """Send an answer; never waits."""
        self._outbox.reply(message + b"\n")

    def send_event(self, payload: EventPayload, latest: bool) -> None:
        """Send an event, or keep it by the policy while the client is behind; never waits."""
        self._outbox.telemetry(payload.topic, latest, _event_line(payload))

    def data_received(self, data: bytes) -> None:
        """Asyncio: bytes from the client, cut anywhere."""
        if not self._hears:
            return
        self.session.heard(self._manager.clock.now_s())
        self._backlog.add(data, self._arrival())
        self._forget_what_was_read()
        if self.closing:
            self._last_look.read(len(data))
        self._go_on()

    def mark_unread(self, arrival: Arrival) -> None:
        """What the kernel holds of this client may have come as early as this."""
        self._unread_since = self._unread_since or arrival

    def _arrival(self) -> Arrival:
        return self._unread_since or self._manager.arrivals.earliest()

    def _forget_what_was_read(self) -> None:
        """Once the kernel has been seen empty, what comes next is new."""
        if self._unread_since is not None and not self._paused and not unread_bytes(self._descriptor):
            self._unread_since = None

    def _go_on(self) -> None:
        """Do what there is room for now, and what else waits for its turn; the first stop in it does not."""
        if self._waits and self._looks:
            return
        scheduler, more = self._manager.scheduler, True
        while more and not self._waits and scheduler.is_free():
            more = self._serve()
        self._looks = self._look()
        while self._looks and not self._waits and scheduler.is_free():
            self._looks = self._look()
        self._wait_or_rest(more)

    def turn(self) -> None:
        """Serve the next request, and look at the next line that may be a stop."""
        self._waits = False
        more = self._serve()
        self._looks = self._look()
        self._wait_or_rest(more)

    def _wait_or_rest(self, more: bool) -> None:
        if self._looks or more:
            self._wait()
        elif not self._hears and not self._backlog and self._at_last is not None:
            at_last, self._at_last = self._at_last, None
            at_last()
        self.session.waits_for_line_end(self._backlog.unfinished)
        self._read_on()

    def _wait(self) -> None:
        if not self._waits:
            self._waits = True
            self._manager.scheduler.wait(self)

    def _serve(self) -> bool:
        """Serve the next request, if there is room for its answer; whether there was one."""
        if self.closing:
            return False
        if self._backlog.too_long:
            longest = self._manager.parameters.max_request_bytes
            self.end(Failure(ErrorKind.REQUEST_TOO_LARGE, f"a request has at most {longest} bytes"))
            return False
        line = None if self._outbox.blocked else self._backlog.take()
        if line is None:
            return False
        self.session.waits_for_line_end(False)
        if line.text:
            self._serve_line(line.text, line.arrival)
        elif not self.session.forgive(self._manager.clock.now_s()):
            self.end(Failure(ErrorKind.FLOODING, "empty lines without end"))
        self._is_ours = True
        return True

    def _serve_line(self, text: bytearray, arrival: Arrival | None = None) -> None:
        """Have one line carried out; what this client sent behind a stop of its own was sent after it."""
        arrivals = self._manager.arrivals
        before = arrivals.stops
        self._manager.dispatcher.serve(self, text, arrival)
        if arrivals.stops == before:
            return
        self._backlog.stopped(before, arrivals.stops)
        if self._unread_since is not None and self._unread_since.stops == before:
            self._unread_since = self._unread_since._replace(stops=arrivals.stops)

    def _look(self) -> bool:
        """Carry out the next stop that waits, before its turn or, at the end, instead; whether there may be more."""
        if self.session.role is None and not self.closing:
            return False  # the token comes first
        if self.closing and not self._is_ours:
            self._judge_first_line()
        line = self._backlog.find()
        if line is not None:
            self._look_at(line)
        if self.closing:
            self._backlog.drop_seen()
        if self._last_look.over:
            self._backlog.clear()
            self._hears = False
        return line is not None

    def _judge_first_line(self) -> None:
        """Who begins with another protocol is not listened to, also when its connection ends for another reason."""
        foreign = self._manager.dispatcher.is_foreign(self._backlog.first())
        self._last_look.over = self._last_look.over or foreign or self._backlog.too_long
        self._is_ours = bool(self._backlog) and not self._backlog.unfinished

    def _look_at(self, line: bytearray) -> None:
        dispatcher = self._manager.dispatcher
        method = dispatcher.early(self.session, line)
        if method is not None:
            self._backlog.take_found()
        if self._last_look.is_to_do(method) if self.closing else method is not None:
            self._serve_line(line)

    def _read_on(self) -> None:
        """Read, unless as much waits as may, or there may be stops in what waits: more would only come after them."""
        if not self._hears:
            return
        full = len(self._backlog) > self._manager.parameters.backlog_bytes
        if full and self._outbox.blocked:
            self._outbox.hurry()
        if full or self._looks:
            if not self._paused:
                self._paused, self._unread_since = True, self._arrival()
            self._transport.pause_reading()
        else:
            self._paused = False
            self._forget_what_was_read()
            self._transport.resume_reading()

    def pause_writing(self) -> None:
        """Asyncio: the client does not read; nothing is served that would need an answer."""
        self._outbox.pause()

    def resume_writing(self) -> None:
        """Asyncio: the client has read; it gets what waited, then its further requests are taken."""
        self._outbox.resume()
        self._go_on()

    def eof_received(self) -> bool:
        """Asyncio: the client has closed its sending side, and so its last line; it gets its answers, and we close."""
        if self._at_last is None:
            self._at_last = self.close
        self._hear_no_more()
        return self._at_last is not None and self._plain is not None  # TLS cannot be closed by halves

    def _hear_no_more(self) -> None:
        """Nothing more comes, or is wanted: the last line has ended, and it remains to see to what waits."""
        self._hears = False
        self._backlog.finish()
        self._go_on()

    def connection_lost(self, exc: Exception | None) -> None:
        """Asyncio: the client is gone, in good order or not; what it still has to say is looked through for stops."""
        self._outbox.lost()
        if self._last_look_ends is not None:
            self._last_look_ends.cancel()
        if self._hears:
            self._backlog.add(self._rest(), self._arrival())
        self._unread.unregister(self._descriptor, self)
        self._manager.remove(self.session)
        self._hears, self._at_last = False, None
        self._backlog.finish()
        self._wait()

    def _give_up(self) -> None:
        """The client reads nothing: it would not read an error either."""
        if self.closing and self._at_last is not None:
            return  # it is being ended; how long it may take to read the rest counts from then
        why = f"read nothing for {self._outbox.patience_s:g} s"
        self._manager.count_ended(self.session, Failure(ErrorKind.TIMED_OUT, why))
        if self.closing:
            self.abort()
        else:
            self._look_for_the_last_time(self.abort)

    def end(self, failure: Failure, *, at_once: bool = False) -> None:
        """Send this error, carry out what stops have come by now, or come while it is read, and close."""
        if self.closing:  # the last look has come upon something that ends it
            self._last_look.over = True
            return
        self._manager.count_ended(self.session, failure)
        self.reply(jsonrpc.error(failure))
        if self._is_hopeless(failure):
            self.close()
        else:
            self._look_for_the_last_time(self.close, at_once)

    def _is_hopeless(self, failure: Failure) -> bool:
        """Whether a client that is ended for this may not stop the robot either: a web page, or one without a token."""
        kind = failure.kind
        foreign = kind in (ErrorKind.PARSE_ERROR, ErrorKind.NOT_UTF8)
        endless = kind is ErrorKind.REQUEST_TOO_LARGE and not self._is_ours
        return foreign or endless or (kind is ErrorKind.WRONG_TOKEN and self.session.role is None)

    def _look_for_the_last_time(self, then: Callable[[], None], at_once: bool = False) -> None:
        self._outbox.shut()
        self._at_last = then
        if at_once:
            self._backlog.add(self._rest(), self._arrival())
            self._hear_no_more()
        else:
            self._last_look_ends = asyncio.get_running_loop().call_later(LAST_LOOK_S, self._hear_no_more)
            self._wait()

    def _rest(self) -> bytes:
        """What the kernel holds, and Linux even after a reset; through TLS it says nothing."""
        try:
            return b"" if self._plain is None else self._plain.recv(LAST_LOOK_BYTES)
        except OSError:  # it holds nothing, or has been closed
            return b""

    @property
    def closing(self) -> bool:
        """Whether the end has begun."""
        return self._outbox.closing

    def close(self) -> None:
        """Close once the client has what was already on its way; it is not heard any more."""
        self._hears = False
        self._backlog.clear()
        self._outbox.close()

    def abort(self) -> None:
        """Close now."""
        self._hears = False
        self._transport.abort()


@lru_cache(maxsize=4)
def _event_line(payload: EventPayload) -> bytes:
    """An event as a line; the fan-out hands one payload to many clients in turn, so the line is made once."""
    return jsonrpc.event(payload) + b"\n"
