"""When bytes can have come, and which commands are void by that: what was sent before a stop, and what is too old.

Bytes that are read now have come at any time since the socket was last looked at, and nobody can tell when: a process
that was frozen, or a computer that slept, finds them all at once. So they count as old as they can be. A beat tells how
old that is: between two of its turns the event loop has looked at every socket that it reads.

Bytes of one client and of another cannot be put in order either. So whatever lies unread in the kernel when a stop is
carried out counts as sent before it, but for what its own client sent behind it.
"""

import fcntl
import select
import termios
from typing import NamedTuple, Protocol

from chefbotd.clock import Clock

BEAT_PERIOD_S = 0.025


class Arrival(NamedTuple):
    """The earliest moment at which bytes can have come, and how many stops had been carried out by then."""

    stamp_s: float
    stops: int


class Inlet(Protocol):
    """A socket that is read."""

    def came_before(self, arrival: Arrival) -> None:
        """What lies unread in the kernel now may have come as early as this."""
        ...


class Arrivals:
    """One for all clients. ``stops`` counts the stops carried out, ``stopped_by`` names whose the last one was.

    ``clock`` must go on while the computer sleeps.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.stops, self.stopped_by = 0, ""
        self._beat_s: float | None = None
        self._looked_s: float | None = None
        self._inlets: dict[int, Inlet] = {}
        self._readable = select.poll()

    def beat(self) -> None:
        """To be called by a timer every ``BEAT_PERIOD_S``."""
        now_s = self._clock.now_s()
        self._looked_s, self._beat_s = now_s if self._beat_s is None else self._beat_s, now_s

    def earliest(self) -> Arrival:
        """Of bytes that have just been read; now, while nothing beats."""
        stamp_s = self._clock.now_s() if self._looked_s is None else self._looked_s
        return Arrival(stamp_s, self.stops)

    def age_s(self, arrival: Arrival) -> float:
        """How old a command may be."""
        return self._clock.now_s() - arrival.stamp_s

    def is_before_a_stop(self, arrival: Arrival) -> bool:
        """Whether a command was sent before a stop that has been carried out, or may have been."""
        return arrival.stops < self.stops

    def watch(self, descriptor: int, inlet: Inlet) -> None:
        """Tell a socket of stops for as long as it is read; one that is closed already has no descriptor."""
        if descriptor < 0:
            return
        self._inlets[descriptor] = inlet
        self._readable.register(descriptor, select.POLLIN)

    def unwatch(self, descriptor: int, inlet: Inlet) -> None:
        """Do so no longer; the descriptor may be another's by now."""
        if self._inlets.get(descriptor) is inlet:
            del self._inlets[descriptor]
            self._readable.unregister(descriptor)

    def stop_carried_out(self, inlet: object, name: str) -> None:
        """A stop of this client has been carried out: what waits unread at any other was sent before it."""
        before = self.earliest()
        for descriptor, _ in self._readable.poll(0):
            if self._inlets[descriptor] is not inlet:
                self._inlets[descriptor].came_before(before)
        self.stops += 1
        self.stopped_by = name


def unread_bytes(descriptor: int) -> int:
    """How much the kernel holds of what has come; of a socket that is closed, nothing."""
    if descriptor < 0:
        return 0
    try:
        return int.from_bytes(fcntl.ioctl(descriptor, termios.FIONREAD, bytes(4)), "little")
    except OSError:
        return 0
