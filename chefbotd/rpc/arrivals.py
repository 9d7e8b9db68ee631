"""Determines when a request can have arrived, and which commands are void because of a stop or their age.

A read returns bytes that arrived at any time since the transport was last polled. Nobody can tell when: a process that
was frozen, or a computer that slept, finds them all at once. So bytes count as old as they can be. A timer ticks to
bound that age: between two ticks the event loop has polled every transport.

The bytes of two clients cannot be put in order either. So whatever is unread when a stop is carried out counts as sent
before the stop, except for what the stop's own client sent behind it.

What waited while the robot drove and nobody watched it was asked for by somebody who could not see what it did.
"""

import math
from collections.abc import Callable

from chefbotd.clock import BEAT_S, Clock
from chefbotd.core.record import Record

SHORT_TICK_S = 0.025
"""How often the timer ticks where commands are void sooner than ``LEAST_TIMEOUT_S``: two ticks are the error of an age.

Elsewhere it ticks with the clock's beat: a wakeup of its own costs about 0.2 ms of the processor.
"""

LEAST_TIMEOUT_S = 10 * BEAT_S


class ByteArrival(Record, frozen=True):
    """The earliest time at which bytes can have arrived, and how many stops had been carried out by then."""

    stamp_s: float
    stops: int


MarkUnread = Callable[[ByteArrival, object], None]
"""Tells every client with unread bytes, except the given one, that they may have arrived as early as this."""


class Arrivals:
    """One for all clients. ``stops`` counts the stops carried out, ``stopped_by`` names who sent the last one.

    ``clock`` must go on while the computer sleeps. ``resumed_s`` tells when the robot was last watched again after a
    pause in which it drove.
    """

    def __init__(self, clock: Clock, resumed_s: Callable[[], float] = lambda: -math.inf) -> None:
        self._clock, self._resumed_s = clock, resumed_s
        self.stops, self.stopped_by = 0, ""
        self._tick_s: float | None = None
        self._previous_tick_s: float | None = None
        self._mark_unread: list[MarkUnread] = []

    def add_transport(self, mark_unread: MarkUnread) -> None:
        """Have a transport mark its unread bytes before each stop."""
        self._mark_unread.append(mark_unread)

    def tick(self) -> None:
        """Note that the event loop has polled its transports."""
        now_s = self._clock.now_s()
        self._previous_tick_s, self._tick_s = now_s if self._tick_s is None else self._tick_s, now_s

    def earliest(self) -> ByteArrival:
        """The earliest arrival of bytes that have just been read; now, as long as there was no tick."""
        stamp_s = self._clock.now_s() if self._previous_tick_s is None else self._previous_tick_s
        return ByteArrival(stamp_s, self.stops)

    def age_s(self, arrival: ByteArrival) -> float:
        """How old a command may be, in seconds."""
        return self._clock.now_s() - arrival.stamp_s

    def is_before_a_stop(self, arrival: ByteArrival) -> bool:
        """Whether a command may have been sent before a stop that has been carried out."""
        return arrival.stops < self.stops

    def is_before_a_pause_ended(self, arrival: ByteArrival) -> bool:
        """Whether a command may have been sent before or in a pause in which the robot drove unwatched."""
        return arrival.stamp_s < self._resumed_s()

    def record_stop(self, client: object, name: str) -> None:
        """Count a stop by ``client``; what is unread from any other client counts as sent before it."""
        before = self.earliest()
        for mark_unread in self._mark_unread:
            mark_unread(before, client)
        self.stops += 1
        self.stopped_by = name
