"""Once a second: what was counted, and how late the event loop was."""

import asyncio
from collections.abc import Callable

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.events import StatsSampled

PROBES_PER_SAMPLE = 10
SAMPLE_PERIOD_S = 1.0


class StatsService:
    """Samples the daemon's counters; ``collect`` makes an event of a stamp and the loop's lag."""

    def __init__(self, bus: Bus, clock: Clock, collect: Callable[[float, float], StatsSampled]) -> None:
        self._bus, self._clock, self._collect = bus, clock, collect
        self._lag_s = 0.0

    def sample(self) -> StatsSampled:
        """The counters now, and the worst lag of the last second."""
        return self._collect(self._clock.now_s(), self._lag_s)

    async def run(self) -> None:
        """Probe the loop's lag and publish a sample every second until cancelled."""
        while True:
            self._lag_s = await self._worst_lag_s()
            self._bus.publish(self.sample())

    async def _worst_lag_s(self) -> float:
        period_s, worst_s = SAMPLE_PERIOD_S / PROBES_PER_SAMPLE, 0.0
        for _ in range(PROBES_PER_SAMPLE):
            before_s = self._clock.now_s()
            await asyncio.sleep(period_s)
            worst_s = max(worst_s, self._clock.now_s() - before_s - period_s)
        return worst_s
