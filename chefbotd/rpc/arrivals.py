"""When a request can have arrived, and which commands are void because of a stop or of their age.

A read returns bytes that arrived at any time since the transport was last polled. Nobody can tell when: a process that
was frozen, or a computer that slept, finds them all at once. So bytes count as old as they can be. A timer ticks to
bound that age: between two ticks the event loop has polled every transport.

The bytes of two clients cannot be put in order either. So whatever is unread when a stop is carried out counts as sent
before the stop, except for what the stop's own client sent behind it.
"""

from collections.abc import Callable
from typing import NamedTuple

from chefbotd.clock import Clock

TICK_PERIOD_S = 0.025
QUIET_TICK_PERIOD_S = 0.05
"""While nobody sends: a wakeup costs about 0.2 ms of the processor, and the first command counts as older by 0.1 s."""

QUIET_S = 1.0
"""Nobody sends when nothing was read for so long."""

LATE_S = 4 * QUIET_TICK_PERIOD_S
LEAST_TIMEOUT_S = 10 * QUIET_TICK_PERIOD_S
"""Where commands are void sooner than this, two ticks would be too much of their time."""


class Arrival(NamedTuple):
    """The earliest time at which bytes can have arrived, and how many stops had been carried out by then."""

    stamp_s: float
    stops: int


MarkUnread = Callable[[Arrival, object], None]
"""Tells every client with unread bytes, except the given one, that they may have arrived as early as this."""


class Arrivals:
    """One for all clients. ``stops`` counts the stops carried out, ``stopped_by`` names who sent the last one.

    ``clock`` must go on while the computer sleeps.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.stops, self.stopped_by = 0, ""
        self._was_read, self._quiet_from_s = False, float("-inf")
        self._tick_s: float | None = None
        self._previous_tick_s: float | None = None
        self._mark_unread: list[MarkUnread] = []

    def add_transport(self, mark_unread: MarkUnread) -> None:
        """Have a transport mark its unread bytes before each stop."""
        self._mark_unread.append(mark_unread)

    def tick(self) -> float:
        """Note that the event loop has polled its transports; return the seconds until the next tick.

        They are ``TICK_PERIOD_S`` while clients send and after a loop that stood still, else ``QUIET_TICK_PERIOD_S``.
        """
        now_s = self._clock.now_s()
        late = self._tick_s is not None and now_s - self._tick_s > LATE_S
        if self._was_read or late:
            self._was_read, self._quiet_from_s = False, now_s + QUIET_S
        self._previous_tick_s, self._tick_s = now_s if self._tick_s is None else self._tick_s, now_s
        return QUIET_TICK_PERIOD_S if now_s >= self._quiet_from_s else TICK_PERIOD_S

    def earliest(self) -> Arrival:
        """The earliest arrival of bytes that have just been read; now, as long as there was no tick."""
        self._was_read = True
        stamp_s = self._clock.now_s() if self._previous_tick_s is None else self._previous_tick_s
        return Arrival(stamp_s, self.stops)

    def age_s(self, arrival: Arrival) -> float:
        """How old a command may be, in seconds."""
        return self._clock.now_s() - arrival.stamp_s

    def is_before_a_stop(self, arrival: Arrival) -> bool:
        """Whether a command may have been sent before a stop that has been carried out."""
        return arrival.stops < self.stops

    def record_stop(self, client: object, name: str) -> None:
        """Count a stop by ``client``; what is unread from any other client counts as sent before it."""
        before = self.earliest()
        for mark_unread in self._mark_unread:
            mark_unread(before, client)
        self.stops += 1
        self.stopped_by = name
