"""Publishes the daemon's figures and the lag of the event loop once a second."""

from chefbotd.bus import Bus
from chefbotd.clock import Clock, next_beat
from chefbotd.core.events import StatsSampled
from chefbotd.entries import entries_of
from chefbotd.metrics import Histogram, Metrics

PROBE_BEATS, PROBES_PER_SAMPLE = 2, 10
"""The loop's lag is probed ten times a second, and a sample is taken once a second."""

LAG_BOUNDS_S = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.25, 1.0)
"""The watchdog stops the motors at 0.25 s."""


class StatsService:
    """Samples the figures of the registry; ``lag_s`` is the loop's worst lag of the last second, ``lags`` has all."""

    def __init__(self, bus: Bus, clock: Clock, metrics: Metrics) -> None:
        self._bus, self._clock, self._metrics = bus, clock, metrics
        self._entries = entries_of(clock)
        self.lag_s, self.lags = 0.0, Histogram(LAG_BOUNDS_S)

    def sample(self) -> StatsSampled:
        """The figures now."""
        return StatsSampled(self._clock.now_s(), self._metrics.collect())

    async def run(self) -> None:
        """Probe the loop's lag and publish a sample every second until cancelled."""
        while True:
            self.lag_s = await self._worst_lag_s()
            self._entries.observe(self._bus, self.sample())

    async def _worst_lag_s(self) -> float:
        worst_s = 0.0
        for _ in range(PROBES_PER_SAMPLE):
            before_s = self._clock.now_s()
            period_s = await next_beat(self._clock, PROBE_BEATS)
            lag_s = max(0.0, self._clock.now_s() - before_s - period_s)
            self.lags.observe(lag_s)
            worst_s = max(worst_s, lag_s)
        return worst_s
