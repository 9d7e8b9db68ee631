"""One client as the house rules see it: who it is, what it may do, and how long it may take."""

from collections.abc import Callable

from chefbotd.messages.roles import Role
from chefbotd.rpc.arrivals import Arrival
from chefbotd.rpc.jsonrpc import ErrorKind, Failure
from chefbotd.rpc.parameters import ApiParameters
from chefbotd.rpc.token_bucket import TokenBucket


class Session:
    """From a client's arrival at ``host:port`` to its end; time is an argument.

    ``role`` is None until the client has shown a token, ``client`` is what it calls itself, ``proven`` says whether it
    has ever sent a request, and ``stops_only`` why it may do nothing but stop the robot (empty: it may do more).
    """

    def __init__(
        self, parameters: ApiParameters, host: str, port: int, role: Role | None, now_s: float
    ) -> None:
        self._parameters = parameters
        self.host, self._port = host, port
        self.role, self.client, self.proven, self.stops_only = role, "", False, ""
        self.arrival: Arrival | None = None  # the earliest at which its connection can have been opened
        self._arrived_s = self._heard_s = now_s
        self._unfinished_s: float | None = None
        self._allowance = TokenBucket(parameters.requests_per_s, parameters.requests_burst, now_s)
        self._patience = TokenBucket(parameters.requests_per_s, parameters.requests_burst, now_s)

    def __str__(self) -> str:
        where = f"[{self.host}]:{self._port}" if ":" in self.host else f"{self.host}:{self._port}"
        return f"{self.client} ({where})" if self.client else where

    def admit(self, now_s: float) -> bool:
        """Whether the client's next request does not come too soon."""
        return self._allowance.take(now_s)

    def forgive(self, now_s: float) -> bool:
        """Whether a line that could not be served may be answered: as many may as requests are served."""
        return self._patience.take(now_s)

    def heard(self, now_s: float) -> None:
        """Bytes have come."""
        self._heard_s = now_s

    def idle_s(self, now_s: float) -> float:
        """For how long no bytes have come."""
        return now_s - self._heard_s

    def waits_for_line_end(self, waits: bool) -> None:
        """Whether a request has begun and not ended."""
        if not waits:
            self._unfinished_s = None
        elif self._unfinished_s is None:
            self._unfinished_s = self._heard_s

    def overdue(self, now_s: float, subscribed: Callable[[], bool]) -> Failure | None:
        """What the client has taken too long for, or None; ``subscribed`` is asked only of a silent client."""
        limits = self._parameters
        if self.role is None and now_s - self._arrived_s > limits.authenticate_s:
            return _timed_out(f"not authenticated within {limits.authenticate_s:g} s")
        if self._unfinished_s is not None and now_s - self._unfinished_s > limits.request_s:
            return _timed_out(f"a request was not complete within {limits.request_s:g} s")
        if now_s - self._heard_s > limits.idle_s and not subscribed():
            return _timed_out(f"neither a request nor a subscription for {limits.idle_s:g} s")
        return None


def _timed_out(why: str) -> Failure:
    return Failure(ErrorKind.TIMED_OUT, why)
