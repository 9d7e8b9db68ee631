"""One client: who it is, what it may do, and how long it may take."""

from collections.abc import Callable

from chefbotd.core.record import Record
from chefbotd.rpc.arrivals import ByteArrival
from chefbotd.rpc.jsonrpc import ErrorKind, Failure
from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.rpc.repeats import RepeatableRequest


class TokenBucket:
    """Holds up to ``size`` tokens and is full at first; ``per_s`` tokens are added each second."""

    def __init__(self, per_s: float, size: float, now_s: float) -> None:
        self._per_s, self._size = per_s, size
        self._level, self._stamp_s = size, now_s

    def take_token(self, now_s: float) -> bool:
        """Take one token; False when there is none."""
        self._level = min(self._size, self._level + (now_s - self._stamp_s) * self._per_s)
        self._stamp_s = now_s
        if self._level < 1.0:
            return False
        self._level -= 1.0
        return True


class SessionState(Record, frozen=True):
    """Who a client is: that is what the robot says of it. Nobody is to know its token."""

    number: int
    client: str
    host: str
    port: int
    role: Role | None


class Session:
    """From a client's arrival at ``host:port`` to its end; time is an argument.

    ``role`` is None until the client has shown a token, ``client`` is what it calls itself, ``proven`` says whether it
    has ever sent a request, and ``stops_only`` why it may do nothing but stop the robot (empty: it may do more).
    ``on_identified`` is called once the client has shown its token, or, where none is asked for, sent a request.
    """

    def __init__(
        self,
        parameters: ApiParameters,
        host: str,
        port: int,
        role: Role | None,
        now_s: float,
        on_identified: Callable[["Session"], None] | None = None,
    ) -> None:
        self._parameters = parameters
        self.host, self._port = host, port
        self.role, self.client, self.proven, self.stops_only = role, "", False, ""
        self.token_digest: bytes | None = None  # of the token that it has shown
        self.number = 0  # of the connections that were admitted
        self.arrival: ByteArrival | None = None  # the earliest at which its connection can have been opened
        self.repeatable: RepeatableRequest | None = None  # its last one of a method that can be renewed
        self._on_identified = on_identified
        self._arrived_s = self._active_s = now_s
        self._incomplete_s: float | None = None
        self._requests = TokenBucket(parameters.requests_per_s, parameters.requests_burst, now_s)
        self._errors = TokenBucket(parameters.requests_per_s, parameters.requests_burst, now_s)

    def __str__(self) -> str:
        return f"{self.client} ({self.where})" if self.client else self.where

    def state(self) -> SessionState:
        """Who it is."""
        return SessionState(self.number, self.client, self.host, self._port, self.role)

    @classmethod
    def restored(cls, state: SessionState) -> "Session":
        """A client of a recording."""
        session = cls(ApiParameters(), state.host, state.port, state.role, 0.0)
        session.number, session.client = state.number, state.client
        return session

    @property
    def where(self) -> str:
        """Its address."""
        return f"[{self.host}]:{self._port}" if ":" in self.host else f"{self.host}:{self._port}"

    def record_request(self) -> None:
        """Note that a request has come."""
        self.proven = True
        self._identify()

    def show_token(self, role: Role, token_digest: bytes | None) -> None:
        """Note the client's token, and what it may do with it."""
        self.role, self.token_digest = role, token_digest
        self._identify()

    def _identify(self) -> None:
        if self.role is not None and self._on_identified is not None:
            on_identified, self._on_identified = self._on_identified, None
            on_identified(self)

    @property
    def identified(self) -> bool:
        """Whether the client has shown its token, or, where none is asked for, sent a request."""
        return self._on_identified is None

    def admit_request(self, now_s: float) -> bool:
        """Whether the client may send another request now."""
        return self._requests.take_token(now_s)

    def admit_error(self, now_s: float) -> bool:
        """Whether another line that cannot be served is tolerated; the rate is that of requests."""
        return self._errors.take_token(now_s)

    def record_activity(self, now_s: float) -> None:
        """Note that bytes have arrived."""
        self._active_s = now_s

    def idle_s(self, now_s: float) -> float:
        """For how long no bytes have arrived."""
        return now_s - self._active_s

    def set_incomplete(self, incomplete: bool) -> None:
        """Note whether a request has begun and not ended."""
        if not incomplete:
            self._incomplete_s = None
        elif self._incomplete_s is None:
            self._incomplete_s = self._active_s

    def overdue(self, now_s: float, subscribed: Callable[[], bool]) -> Failure | None:
        """What the client has taken too long for, or None; ``subscribed`` is asked only of a silent client."""
        limits = self._parameters
        if self.role is None and now_s - self._arrived_s > limits.authenticate_timeout_s:
            return _timed_out(f"not authenticated within {limits.authenticate_timeout_s:g} s")
        if self._incomplete_s is not None and now_s - self._incomplete_s > limits.request_timeout_s:
            return _timed_out(f"a request was not complete within {limits.request_timeout_s:g} s")
        if now_s - self._active_s > limits.idle_timeout_s and not subscribed():
            return _timed_out(f"neither a request nor a subscription for {limits.idle_timeout_s:g} s")
        return None


def _timed_out(why: str) -> Failure:
    return Failure(ErrorKind.TIMED_OUT, why)
