"""Manages all clients: admits them while there is room, checks their time limits, and disconnects them at the end.

A new connection has one of the slots that addresses share fairly until it is identified: it has shown its token, or,
where none is asked for, sent a request. Only new connections give way to new ones.

An identified client takes a place among the clients. Where there is none, a few places remain in which a client may
only stop the robot, and the oldest client in them gives way to the next. So neither a crowd that shows nothing nor too
many clients keep anybody from the emergency stop.
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
from chefbotd.inputs import inputs_of
from chefbotd.logs import RateLimitedLog
from chefbotd.rpc.arrivals import Arrivals, ByteArrival
from chefbotd.rpc.connection_slots import ConnectionSlots, NoSlot, address_group
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.jsonrpc import ErrorKind, Failure
from chefbotd.rpc.method import Caller, Receiver
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


REPLACED = "replaced by a new client"


class Headroom(Enum):
    """Whether a transport has resources (descriptors, memory) for one more client."""

    ENOUGH = auto()
    LOW = auto()
    """For a client for which others are disconnected."""
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


class Subscriptions(Protocol):
    """Who is subscribed to what."""

    def is_subscribed(self, receiver: Receiver, /) -> bool:
        """Whether a receiver takes any topic."""
        ...

    def remove_receiver(self, receiver: Receiver, /) -> None:
        """Take a receiver out of all topics."""
        ...


class ConnectionManager:
    """``greeting`` makes the first message, empty: there is none.

    ``role`` is what a new client may do, None: nothing before its token.

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
        fanout: Subscriptions,
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
        self._new = ConnectionSlots[Session](parameters.max_new_connections)
        self._stop_places = ConnectionSlots[Session](parameters.reserved_stop_connections, hold_s=0.0)
        self._clients: dict[Session, None] = {}  # that may do everything
        self._replaced = set[Session]()  # before they were connected
        self._log = RateLimitedLog(structlog.get_logger(__name__))
        self._entries, self._numbers = inputs_of(clock), count(1)

    def __len__(self) -> int:
        return len(self._sessions)

    def admit(
        self, host: str, port: int, arrival: ByteArrival | None = None, headroom: Headroom = Headroom.ENOUGH
    ) -> Session | Failure:
        """A new client's session, or why there is no room; ``arrival`` is the earliest for its first byte."""
        now_s = self.clock.now_s()
        session = Session(self.parameters, host, port, self._role, now_s, self._place)
        session.arrival, session.number = arrival, next(self._numbers)
        try:
            if headroom is Headroom.NONE:
                raise NoSlot("the daemon is short of file descriptors")
            evicted = self._new.add(session, host, now_s, scarce=headroom is Headroom.LOW)
        except NoSlot as problem:
            failure = Failure(ErrorKind.TOO_MANY_CLIENTS, str(problem))
            self.count_ended(session, failure)
            return failure
        for gives_way in evicted:
            self.disconnect(gives_way)
        self._sessions[session] = None
        return session

    def _place(self, session: Session) -> None:
        """Give an identified client a place; where there is none, its connection ends after what it has sent."""
        self._new.remove(session)
        if session not in self._sessions:
            return  # it has gone; what it had sent is still searched for stops
        no_room = self._no_room(session.host)
        if not no_room or self._disconnect_idle(session.host):
            self._clients[session] = None
            return
        session.stops_only = no_room
        try:
            evicted = self._stop_places.add(session, session.host, self.clock.now_s())
        except NoSlot:
            asyncio.get_running_loop().call_soon(self._end_session, session, no_room)
        else:
            for gives_way in evicted:
                self.disconnect(gives_way)

    def _end_session(self, session: Session, no_room: str) -> None:
        connection = self._sessions.get(session)
        if connection is not None and not connection.closing:
            connection.end(Failure(ErrorKind.TOO_MANY_CLIENTS, no_room))

    def _no_room(self, host: str) -> str:
        """Why a client could only stop the robot; empty when it may do everything."""
        groups = [address_group(s.host) for s in self._clients if not self._is_closing(s)]
        if len(groups) >= self.parameters.max_clients:
            return f"already {len(groups)} clients"
        own = groups.count(address_group(host))
        if own >= self.parameters.max_clients_per_address:
            return f"already {own} clients from {host}"
        return ""

    def _is_closing(self, session: Session) -> bool:
        connection = self._sessions.get(session)
        return connection is not None and connection.closing

    def _disconnect_idle(self, host: str) -> bool:
        """Disconnect the client that has been idle longest, neither drives nor is subscribed; whether there was one.

        It is one of the newcomer's address where that has too many clients, else of the address with the most that are
        idle.
        """
        now_s, group = self.clock.now_s(), address_group(host)
        own = [s for s in self._clients if address_group(s.host) == group]
        crowded = len(own) >= self.parameters.max_clients_per_address
        idle = [s for s in (own if crowded else self._clients) if self._is_idle(s, now_s)]
        by_group = Counter(address_group(s.host) for s in idle)
        if not idle:
            return False
        return self.disconnect(max(idle, key=lambda s: (by_group[address_group(s.host)], s.idle_s(now_s))))

    def _is_idle(self, session: Session, now_s: float) -> bool:
        connection = self._sessions.get(session)
        if connection is None or connection.closing or session.idle_s(now_s) < IDLE_S:
            return False
        return not self._fanout.is_subscribed(connection) and not self._control.has(session)

    def disconnect(self, session: Session) -> bool:
        """Disconnect a client for a new one; False for one that is not connected yet, which ends once it is."""
        failure = Failure(ErrorKind.TOO_MANY_CLIENTS, REPLACED)
        connection, cancel = self._sessions.get(session), self._handshakes.get(session)
        if connection is not None:
            connection.end(failure, at_once=True)
        elif cancel is not None:
            self.count_ended(session, failure)
            self.remove(session)
            cancel()
        else:
            self._replaced.add(session)
        return connection is not None or cancel is not None

    def add_handshake(self, session: Session, cancel: Callable[[], object]) -> None:
        """An admitted client is in its TLS handshake, which ``cancel`` ends."""
        self._handshakes[session] = cancel

    def add(self, connection: Connection) -> bytes:
        """An admitted client is connected; the greeting for it."""
        session = connection.session
        self._sessions[session] = connection
        self._handshakes.pop(session, None)
        if session in self._replaced:
            self._replaced.remove(session)
            asyncio.get_running_loop().call_soon(self.disconnect, session)
        return self._greeting()

    def remove(self, session: Session) -> None:
        """A client is gone, with its subscriptions, its leases and its jobs."""
        connection = self._sessions.pop(session, None)
        self._handshakes.pop(session, None)
        self._replaced.discard(session)
        self._new.remove(session)
        self._stop_places.remove(session)
        self._clients.pop(session, None)
        if not session.identified:
            return
        if connection is not None:
            self._fanout.remove_receiver(connection)
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
        """Apply exchanged tokens: each client gets its token's present role, or is disconnected.

        One that is disconnected may still stop the robot by what it has sent already: somebody pressed that.
        """
        for connection in self._connections():
            session = connection.session
            if session.token_digest is None:
                continue
            role = role_of_digest(session.token_digest)
            session.role = role or Role.OBSERVE
            if role is None and not connection.closing:
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
