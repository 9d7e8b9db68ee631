"""Once a second: what was counted, and how late the event loop was."""

import asyncio

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.events import StatsSampled
from chefbotd.entries import entries_of
from chefbotd.metrics import Histogram, Metrics

PROBES_PER_SAMPLE = 10
SAMPLE_PERIOD_S = 1.0
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
        period_s, worst_s = SAMPLE_PERIOD_S / PROBES_PER_SAMPLE, 0.0
        for _ in range(PROBES_PER_SAMPLE):
            before_s = self._clock.now_s()
            await asyncio.sleep(period_s)
            lag_s = max(0.0, self._clock.now_s() - before_s - period_s)
            self.lags.observe(lag_s)
            worst_s = max(worst_s, lag_s)
        return worst_s
