"""Everyone who is connected: let in while there is room, held to the time limits, seen off at the end."""

import resource
from collections import Counter
from collections.abc import Callable
from functools import partial

import structlog

from chefbotd.api.connection import Connection
from chefbotd.api.control import Control
from chefbotd.api.dispatch import Dispatcher
from chefbotd.api.fanout import Fanout
from chefbotd.api.jsonrpc import ErrorKind, Failure
from chefbotd.api.parameters import ApiParameters
from chefbotd.api.roles import Role
from chefbotd.api.session import Session
from chefbotd.clock import Clock
from chefbotd.logs import RateLimitedLog

RESERVED_DESCRIPTORS = 32
"""Left for the serial link to reopen its device, and for everything else that is no client."""


class Lobby:
    """``greet`` makes the greeting; ``role`` is what a newcomer may do, None: nothing before it shows a token.

    ``drops`` counts telemetry that slow clients lost by topic, ``refused`` the connections that were refused or ended
    by the kind of error.
    """

    def __init__(
        self,
        parameters: ApiParameters,
        clock: Clock,
        dispatcher: Dispatcher,
        fanout: Fanout,
        control: Control,
        greet: Callable[[], bytes],
        role: Role | None,
    ) -> None:
        self.parameters, self.clock, self.dispatcher = parameters, clock, dispatcher
        self.drops: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self._fanout, self._control, self._greet, self._role = fanout, control, greet, role
        self._hosts: dict[Session, str] = {}
        self._connections: set[Connection] = set()
        self._most_descriptors = resource.getrlimit(resource.RLIMIT_NOFILE)[0] - RESERVED_DESCRIPTORS
        self._log = RateLimitedLog(structlog.get_logger(__name__))

    def __len__(self) -> int:
        return len(self._hosts)

    def admit(self, host: str, port: int, descriptor: int) -> Session | Failure:
        """A newcomer's session, or why there is no room; ``descriptor`` is its socket's, the lowest that was free."""
        session = Session(self.parameters, host, port, self._role, self.clock.now_s())
        problem = self._crowded(host, descriptor)
        if problem is not None:
            failure = Failure(ErrorKind.TOO_MANY_CLIENTS, problem)
            self.ended(session, failure)
            return failure
        self._hosts[session] = host
        return session

    def _crowded(self, host: str, descriptor: int) -> str | None:
        if len(self) >= self.parameters.max_clients:
            return f"already {len(self)} clients"
        from_there = sum(other == host for other in self._hosts.values())
        if from_there >= self.parameters.max_clients_per_address:
            return f"already {from_there} clients from {host}"
        if descriptor >= self._most_descriptors:
            return "the daemon is short of file descriptors"
        return None

    def leave(self, session: Session) -> None:
        """A client is gone; its leases end with it."""
        if self._hosts.pop(session, None) is not None:
            self._control.release(session, self.clock.now_s())

    def welcome(self, connection: Connection) -> bytes:
        """Take in a client that was admitted; the greeting for it."""
        self._connections.add(connection)
        return self._greet()

    def ended(self, session: Session, failure: Failure) -> None:
        """Count and log a connection that is refused or ended."""
        self.refused[str(failure.kind)] += 1
        self._log.warning(
            "client_refused", client=str(session), kind=str(failure.kind), reason=failure.message
        )

    def farewell(self, connection: Connection) -> None:
        """A client is gone, with its subscriptions and its leases."""
        self._connections.discard(connection)
        self._fanout.unsubscribe(connection)
        self.leave(connection.session)

    def sweep(self) -> None:
        """End what has outlived its time: leases, and connections of clients that take too long."""
        now_s = self.clock.now_s()
        self._control.expire(now_s)
        for connection in tuple(self._connections):
            late = connection.session.overdue(now_s, partial(self._fanout.is_subscribed, connection))
            if late is not None and not connection.closing:
                connection.end(late)

    def close(self) -> None:
        """Close every connection once it has its answers. What the robot does now is not the clients' to say."""
        self._control.forget()
        for connection in tuple(self._connections):
            connection.close()

    def abort(self) -> None:
        """Close every connection that is left, now."""
        for connection in tuple(self._connections):
            connection.abort()
