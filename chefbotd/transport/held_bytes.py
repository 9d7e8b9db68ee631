"""How old the bytes of one client can be that are not a request yet: in the kernel, or the beginning of a request."""

from chefbotd.rpc.arrivals import Arrival, Arrivals


class HeldBytes:
    """``unread_since`` is the earliest arrival of what the kernel holds; None: it holds nothing."""

    def __init__(self, arrivals: Arrivals, unread_since: Arrival | None) -> None:
        self._arrivals, self.unread_since = arrivals, unread_since
        self._partial_since: Arrival | None = None

    def mark_unread(self, arrival: Arrival) -> None:
        """What the kernel holds may have arrived as early as this."""
        self.unread_since = self.unread_since or arrival

    def arrival_of(self, lines: bytes, *, partial: bool) -> Arrival:
        """The arrival of the lines that were just read. The first of them is as old as its first byte.

        ``partial``: a request has begun, and not ended.
        """
        arrival = self.unread_since or self._arrivals.earliest()
        first = self._partial_since or arrival
        if not partial:
            self._partial_since = None
        elif lines or self._partial_since is None:
            self._partial_since = arrival
        return first

    def record_own_stop(self, before: int, now: int) -> None:
        """The client's own stop, number ``now`` after ``before``, was carried out: what it holds was sent after it."""
        self.unread_since = _after_stop(self.unread_since, before, now)
        self._partial_since = _after_stop(self._partial_since, before, now)


def _after_stop(arrival: Arrival | None, before: int, now: int) -> Arrival | None:
    return arrival._replace(stops=now) if arrival is not None and arrival.stops == before else arrival
