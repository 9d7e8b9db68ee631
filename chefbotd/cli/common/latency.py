"""Latencies of a connection: round trips, and the age of telemetry on arrival, from stamps of two clocks."""

import math
from collections.abc import Sequence

from msgspec import Struct, field

from chefbotd.core.record import Record


class Ping(Record, frozen=True):
    """One ping: sent and received by our clock, answered with a stamp of the daemon's clock."""

    sent_s: float
    received_s: float
    stamp_s: float

    @property
    def round_trip_s(self) -> float:
        """From request to answer."""
        return self.received_s - self.sent_s

    @property
    def clock_offset_s(self) -> float:
        """The daemon's clock minus ours, assuming equal delay both ways; off by half a round trip at most."""
        return self.stamp_s - (self.sent_s + self.received_s) / 2


class Latencies(Struct):
    """Pings and arrivals on a connection; an arrival is our time and the daemon's stamp of an event."""

    pings: list[Ping] = field(default_factory=list)
    arrivals: list[tuple[float, float]] = field(default_factory=list)

    def round_trips_s(self) -> list[float]:
        """Of every ping."""
        return [ping.round_trip_s for ping in self.pings]

    def ages_s(self) -> list[float]:
        """Of every event when it arrived, the clocks compared by the quickest ping (as NTP does)."""
        if not self.pings:
            return []
        clock_offset_s = min(self.pings, key=lambda ping: ping.round_trip_s).clock_offset_s
        return [received_s + clock_offset_s - stamp_s for received_s, stamp_s in self.arrivals]


def percentile(values: Sequence[float], percent: float) -> float:
    """The nearest-rank percentile, always one of the values; not a number when there are none."""
    if not values:
        return math.nan
    rank = math.ceil(percent / 100 * len(values))
    return sorted(values)[max(rank, 1) - 1]
