"""Once a second: what was counted, and how late the event loop was."""

import asyncio

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.events import StatsSampled
from chefbotd.entries import entries_of
from chefbotd.metrics import Metrics

PROBES_PER_SAMPLE = 10
SAMPLE_PERIOD_S = 1.0


class StatsService:
    """Samples the figures of the registry; ``lag_s`` is the worst lag of the loop in the last second."""

    def __init__(self, bus: Bus, clock: Clock, metrics: Metrics) -> None:
        self._bus, self._clock, self._metrics = bus, clock, metrics
        self._entries = entries_of(clock)
        self.lag_s = 0.0

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
            worst_s = max(worst_s, self._clock.now_s() - before_s - period_s)
        return worst_s
