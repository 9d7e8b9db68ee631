"""Manages all clients: admits them while there is room, checks their time limits, and disconnects them at the end.

Where there is no room, a few places remain in which a client may only stop the robot. Filling all other places
therefore keeps nobody from the emergency stop. When these places are taken too, the oldest client in them has to
go, even during its TLS handshake.
"""

import asyncio
from collections import Counter, deque
from collections.abc import Callable
from enum import Enum, auto
from functools import partial
from itertools import count
from typing import Protocol

import structlog

from chefbotd.clock import Clock
from chefbotd.core.events import ClientDisconnected
from chefbotd.core.events.inputs import ClientLeft, TimerFired
from chefbotd.entries import entries_of
from chefbotd.logs import RateLimitedLog
from chefbotd.rpc.arrivals import Arrival, Arrivals
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.fanout import Fanout
from chefbotd.rpc.jsonrpc import ErrorKind, Failure
from chefbotd.rpc.method import Caller
from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.rpc.session import Session

# Limits what all clients together may cost per iteration of the event loop, and shares it among them.
#
# An iteration has room for a number of requests and for an amount of time, whichever is used up first, however many
# clients ask. A client that asks while there is room is served at once. The others queue, and each is served one request
# when it reaches the head (round robin): so a client waits for one request of every other client, not for all that they
# have sent, and the control loop waits for one such slice.

SLICE_S = 0.002
"""A control step takes a few loop iterations from its encoder frame: with a slice in each it is still in time."""


class Schedulable(Protocol):
    """A client with requests that wait."""

    def run_scheduled(self) -> None:
        """Serve one of the requests that wait, and queue again when there are more."""
        ...


class FairScheduler:
    """Serves at most ``requests_per_turn`` requests of all clients per loop iteration, for at most ``SLICE_S``."""

    def __init__(self, clock: Clock, requests_per_turn: int) -> None:
        self._clock, self._requests_per_turn = clock, requests_per_turn
        self._queue: deque[Schedulable] = deque()
        self._next_slice: asyncio.Handle | None = None
        self._requests_left, self._until_s = 0, 0.0

    def add(self, client: Schedulable) -> None:
        """Append a client to the queue."""
        self._queue.append(client)
        self._plan_next_slice()

    def try_acquire(self) -> bool:
        """Take room for one request in this iteration; False when there is none, or others wait for it."""
        if self._next_slice is None:
            self._begin_slice()
        return not self._queue and self._has_room()

    def _has_room(self) -> bool:
        self._requests_left -= 1
        return self._requests_left >= 0 and self._clock.now_s() < self._until_s

    def _begin_slice(self) -> None:
        self._requests_left, self._until_s = self._requests_per_turn, self._clock.now_s() + SLICE_S
        self._plan_next_slice()

    def _plan_next_slice(self) -> None:
        if self._next_slice is None:
            self._next_slice = asyncio.get_running_loop().call_soon(self._run_slice)

    def _run_slice(self) -> None:
        """Serve queued clients while there is room; clients that arrive during this iteration share what is left."""
        self._next_slice = None
        if not self._queue:
            return
        self._begin_slice()
        while self._queue and self._has_room():
            self._queue.popleft().run_scheduled()


LEASES_TIMER = "leases"
"""What the regular look at the leases is called in a recording."""

IDLE_S = 5.0
"""A client that has sent nothing for this long may be disconnected to make room for a new one."""


class Headroom(Enum):
    """Whether a transport has resources (descriptors, memory) for one more client."""

    ENOUGH = auto()
    LOW = auto()
    """For a client that only stops the robot, or after another one is disconnected."""
    NONE = auto()


class Connection(Caller, Protocol):
    """A client's connection, whatever the transport."""

    @property
    def closing(self) -> bool:
        """Whether the connection has begun to end."""
        ...

    def end(self, failure: Failure, *, at_once: bool = False) -> None:
        """Send this error, carry out the stops that have arrived, and close; ``at_once``: wait for no more bytes."""
        ...

    def close(self) -> None:
        """Close once the client has what is on its way."""
        ...

    def abort(self) -> None:
        """Close now."""
        ...


class ConnectionManager:
    """``greeting`` makes the first message; ``role`` is what a new client may do, None: nothing before its token.

    ``announce_left`` is told of each client that leaves.
    ``drops`` counts telemetry that slow clients lost by topic, ``refused`` the connections that were refused or ended
    by the kind of error.
    """

    def __init__(
        self,
        parameters: ApiParameters,
        clock: Clock,
        dispatcher: Dispatcher,
        arrivals: Arrivals,
        fanout: Fanout,
        control: ControlLeases,
        greeting: Callable[[], bytes],
        role: Role | None,
        announce_left: Callable[[ClientDisconnected], None],
    ) -> None:
        self.parameters, self.clock, self.dispatcher, self.arrivals = parameters, clock, dispatcher, arrivals
        self.scheduler = FairScheduler(clock, parameters.requests_per_turn)
        self.drops: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self._fanout, self._control, self._greeting, self._role = fanout, control, greeting, role
        self._announce_left = announce_left
        self._sessions: dict[
            Session, Connection | None
        ] = {}  # by arrival; None: not connected yet, as during TLS
        self._handshakes: dict[Session, Callable[[], object]] = {}
        self._log = RateLimitedLog(structlog.get_logger(__name__))
        self._entries, self._numbers = entries_of(clock), count(1)

    def __len__(self) -> int:
        return len(self._sessions)

    def admit(
        self, host: str, port: int, arrival: Arrival | None = None, headroom: Headroom = Headroom.ENOUGH
    ) -> Session | Failure:
        """A new client's session, or why there is no room; ``arrival`` is the earliest for its first byte."""
        session = Session(self.parameters, host, port, self._role, self.clock.now_s())
        session.arrival, session.number = arrival, next(self._numbers)
        no_room = self._no_room(host, headroom)
        if no_room and headroom is not Headroom.NONE and self._disconnect_idle(host):
            no_room = ""
        session.stops_only = no_room
        if no_room and (headroom is Headroom.NONE or not self._make_stop_place()):
            failure = Failure(ErrorKind.TOO_MANY_CLIENTS, no_room)
            self.count_ended(session, failure)
            return failure
        self._sessions[session] = None
        return session

    def _no_room(self, host: str, headroom: Headroom) -> str:
        """Why a client could only stop the robot; empty when it may do everything."""
        hosts = [s.host for s in self._sessions if not s.stops_only and not self._is_closing(s)]
        if len(hosts) >= self.parameters.max_clients:
            return f"already {len(hosts)} clients"
        if hosts.count(host) >= self.parameters.max_clients_per_address:
            return f"already {hosts.count(host)} clients from {host}"
        return "" if headroom is Headroom.ENOUGH else "the daemon is short of file descriptors"

    def _is_closing(self, session: Session) -> bool:
        connection = self._sessions[session]
        return connection is not None and connection.closing

    def _disconnect_idle(self, host: str) -> bool:
        """Disconnect the client that has been idle longest, neither drives nor is subscribed; whether there was one.

        Where one address has too many clients, it is one of that address.
        """
        now_s, sessions = self.clock.now_s(), self._sessions
        own = [s for s in sessions if s.host == host and not s.stops_only]
        candidates = own if len(own) >= self.parameters.max_clients_per_address else list(sessions)
        idle = [s for s in candidates if self._is_idle(s, now_s)]
        return bool(idle) and self._make_room(max(idle, key=lambda s: s.idle_s(now_s)))

    def _is_idle(self, session: Session, now_s: float) -> bool:
        connection = self._sessions[session]
        if connection is None or connection.closing or session.stops_only or session.idle_s(now_s) < IDLE_S:
            return False
        return not self._fanout.is_subscribed(connection) and not self._control.has(session)

    def _make_stop_place(self) -> bool:
        """Whether there is a place for a client that may only stop. May disconnect the oldest one for it."""
        occupants = [s for s in self._sessions if s.stops_only and not self._is_closing(s)]
        return len(occupants) < self.parameters.reserved_stop_connections or any(
            self._make_room(session) for session in occupants
        )

    def _make_room(self, session: Session) -> bool:
        """Disconnect a client; False for one that is neither connected nor in its handshake."""
        failure = Failure(ErrorKind.TOO_MANY_CLIENTS, "replaced by a new client")
        connection, cancel = self._sessions[session], self._handshakes.get(session)
        if connection is not None:
            connection.end(failure, at_once=True)
        elif cancel is not None:
            self.count_ended(session, failure)
            self.remove(session)
            cancel()
        return connection is not None or cancel is not None

    def add_handshake(self, session: Session, cancel: Callable[[], object]) -> None:
        """An admitted client is in its TLS handshake, which ``cancel`` ends."""
        self._handshakes[session] = cancel

    def add(self, connection: Connection) -> bytes:
        """An admitted client is connected; the greeting for it."""
        self._sessions[connection.session] = connection
        self._handshakes.pop(connection.session, None)
        return self._greeting()

    def remove(self, session: Session) -> None:
        """A client is gone, with its subscriptions, its leases and its jobs."""
        connection = self._sessions.pop(session, None)
        self._handshakes.pop(session, None)
        if connection is not None:
            self._fanout.unsubscribe(connection)
        with self._entries.entry(ClientLeft, session.number):
            self.leave(session)
        self.dispatcher.jobs.cancel_all(session)

    def leave(self, session: Session) -> None:
        """What a client had ends: its leases, and whatever else was for it alone."""
        now_s = self._entries.now_s()
        self._control.release(session, now_s)
        self._announce_left(ClientDisconnected(now_s, session.number))

    def count_ended(self, session: Session, failure: Failure) -> None:
        """Count and log a connection that is refused or ended."""
        self.refused[str(failure.kind)] += 1
        self._log.warning(
            "client_refused", client=str(session), kind=str(failure.kind), reason=failure.message
        )

    def sweep(self) -> None:
        """End leases that are over, and connections of clients that take too long."""
        if self._control.any_held and not self._entries.is_replay:  # there, they end as they did then
            with self._entries.entry(TimerFired, LEASES_TIMER):
                self._control.expire(self._entries.now_s())
        now_s = self.clock.now_s()
        for connection in self._connections():
            late = connection.session.overdue(now_s, partial(self._fanout.is_subscribed, connection))
            if late is not None and not connection.closing:
                connection.end(late)

    def check_tokens(self, role_of_digest: Callable[[bytes], Role | None]) -> None:
        """Apply exchanged tokens: each client gets its token's present role, or is disconnected."""
        for connection in self._connections():
            session = connection.session
            if session.token_digest is None:
                continue
            session.role = role_of_digest(session.token_digest)
            if session.role is None and not connection.closing:
                connection.end(Failure(ErrorKind.WRONG_TOKEN, "this token is no longer valid"))

    def _connections(self) -> list[Connection]:
        return [connection for connection in self._sessions.values() if connection is not None]

    def close(self) -> None:
        """Close every connection once it has its answers; the daemon, not a client, decides what the robot does now."""
        self._control.forget()
        for connection in self._connections():
            connection.close()

    def abort(self) -> None:
        """Close every connection that is left, now."""
        for connection in self._connections():
            connection.abort()
