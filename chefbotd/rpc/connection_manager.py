"""Everyone who is connected: let in while there is room, held to the time limits, seen off at the end.

Where there is no room, a few places are left in which a client may do nothing but stop the robot: whoever fills all
the others does not keep the emergency stop from anybody. When these are taken too, who has been there longest goes,
be it still in its TLS handshake.
"""

import resource
from collections import Counter
from collections.abc import Callable
from functools import partial

import structlog

from chefbotd.clock import Clock
from chefbotd.logs import RateLimitedLog
from chefbotd.messages.roles import Role
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.fair_scheduler import FairScheduler
from chefbotd.rpc.fanout import Fanout
from chefbotd.rpc.jsonrpc import ErrorKind, Failure
from chefbotd.rpc.parameters import ApiParameters
from chefbotd.rpc.session import Session
from chefbotd.transport.tcp.arrivals import Arrival, Arrivals
from chefbotd.transport.tcp.connection import Connection

IDLE_S = 5.0
"""A client that asks nothing for so long gives way to a newcomer where there is no room."""
GIVING_WAY_DESCRIPTORS = 8
"""A newcomer has one more descriptor until who gives way to it has closed its own."""
RESERVED_DESCRIPTORS = 32
"""Left for the serial link to reopen its device, for the places kept for stops, and for all that is no client."""


class ConnectionManager:
    """``greet`` makes the greeting; ``role`` is what a newcomer may do, None: nothing before it shows a token.

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
        greet: Callable[[], bytes],
        role: Role | None,
    ) -> None:
        self.parameters, self.clock, self.dispatcher, self.arrivals = parameters, clock, dispatcher, arrivals
        self.turns = FairScheduler(clock, parameters.requests_per_turn)
        self.drops: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self._fanout, self._control, self._greet, self._role = fanout, control, greet, role
        self._sessions: dict[Session, Connection | None] = {}  # by arrival; None: on its way, as during TLS
        self._handshakes: dict[Session, Callable[[], object]] = {}
        self._most_descriptors = resource.getrlimit(resource.RLIMIT_NOFILE)[0] - RESERVED_DESCRIPTORS
        self._last_descriptor = self._most_descriptors + parameters.stop_places + GIVING_WAY_DESCRIPTORS
        self._log = RateLimitedLog(structlog.get_logger(__name__))

    def __len__(self) -> int:
        return len(self._sessions)

    def admit(self, host: str, port: int, descriptor: int, came: Arrival | None = None) -> Session | Failure:
        """A newcomer's session, or why there is no room; ``descriptor`` is its socket's, the lowest that was free."""
        session = Session(self.parameters, host, port, self._role, self.clock.now_s())
        session.came = came
        crowded = self._crowded(host, descriptor)
        session.stops_only = "" if crowded and self._idle_client_gives_way(host, descriptor) else crowded
        if session.stops_only and not self._make_place(descriptor):
            failure = Failure(ErrorKind.TOO_MANY_CLIENTS, session.stops_only)
            self.ended(session, failure)
            return failure
        self._sessions[session] = None
        return session

    def _crowded(self, host: str, descriptor: int) -> str:
        """Why there is no room for everything; empty when there is."""
        hosts = [
            s.host
            for s, c in self._sessions.items()
            if not s.stops_only and not (c is not None and c.closing)
        ]
        if len(hosts) >= self.parameters.max_clients:
            return f"already {len(hosts)} clients"
        if hosts.count(host) >= self.parameters.max_clients_per_address:
            return f"already {hosts.count(host)} clients from {host}"
        if descriptor >= self._most_descriptors:
            return "the daemon is short of file descriptors"
        return ""

    def _idle_client_gives_way(self, host: str, descriptor: int) -> bool:
        """Whether the client that has been idle longest could be ended: one that drives nothing and receives nothing.

        Where one address has too many, it is one of that address.
        """
        if descriptor >= self._last_descriptor:
            return False
        now_s, sessions = self.clock.now_s(), self._sessions
        own = [s for s in sessions if s.host == host and not s.stops_only]
        among = own if len(own) >= self.parameters.max_clients_per_address else list(sessions)
        idle = [s for s in among if self._may_give_way(s, now_s)]
        return bool(idle) and self._give_way(max(idle, key=lambda s: s.idle_s(now_s)))

    def _may_give_way(self, session: Session, now_s: float) -> bool:
        connection = self._sessions[session]
        if connection is None or connection.closing or session.stops_only or session.idle_s(now_s) < IDLE_S:
            return False
        return not self._fanout.is_subscribed(connection) and not self._control.has(session)

    def _make_place(self, descriptor: int) -> bool:
        """Whether there is a place for a newcomer who may only stop the robot, if need be by ending the oldest."""
        places = self.parameters.stop_places
        if descriptor >= self._last_descriptor:
            return False
        taken = [s for s, c in self._sessions.items() if s.stops_only and not (c is not None and c.closing)]
        return len(taken) < places or any(self._give_way(session) for session in taken)

    def _give_way(self, session: Session) -> bool:
        """Whether a client's place could be freed; not in the moment between its arrival and its greeting."""
        failure = Failure(ErrorKind.TOO_MANY_CLIENTS, "gave way to a newcomer")
        connection, break_off = self._sessions[session], self._handshakes.get(session)
        if connection is not None:
            connection.end(failure, at_once=True)
        elif break_off is not None:
            self.ended(session, failure)
            self.leave(session)
            break_off()
        return connection is not None or break_off is not None

    def shakes_hands(self, session: Session, break_off: Callable[[], object]) -> None:
        """A client that was admitted is in its TLS handshake; it gives way by ``break_off``."""
        self._handshakes[session] = break_off

    def leave(self, session: Session) -> None:
        """A client is gone; its leases end with it."""
        self._sessions.pop(session, None)
        self._handshakes.pop(session, None)
        self._control.release(session, self.clock.now_s())

    def welcome(self, connection: Connection) -> bytes:
        """Take in a client that was admitted; the greeting for it."""
        self._sessions[connection.session] = connection
        self._handshakes.pop(connection.session, None)
        return self._greet()

    def _connected(self) -> list[Connection]:
        return [connection for connection in self._sessions.values() if connection is not None]

    def ended(self, session: Session, failure: Failure) -> None:
        """Count and log a connection that is refused or ended."""
        self.refused[str(failure.kind)] += 1
        self._log.warning(
            "client_refused", client=str(session), kind=str(failure.kind), reason=failure.message
        )

    def farewell(self, connection: Connection) -> None:
        """A client is gone, with its subscriptions and its leases."""
        self._fanout.unsubscribe(connection)
        self.leave(connection.session)

    def sweep(self) -> None:
        """End what has outlived its time: leases, and connections of clients that take too long."""
        now_s = self.clock.now_s()
        self._control.expire(now_s)
        for connection in self._connected():
            late = connection.session.overdue(now_s, partial(self._fanout.is_subscribed, connection))
            if late is not None and not connection.closing:
                connection.end(late)

    def close(self) -> None:
        """Close every connection once it has its answers. What the robot does now is not the clients' to say."""
        self._control.forget()
        for connection in self._connected():
            connection.close()

    def abort(self) -> None:
        """Close every connection that is left, now."""
        for connection in self._connected():
            connection.abort()
