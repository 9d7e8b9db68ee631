"""The statistics, once a second."""

import asyncio

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.statistics.service import StatsService
from chefbotd.core.events import StatsSampled
from chefbotd.metrics import Metrics


class LateClock:
    """The loop's clock, with a hold-up of a quarter of a second at a given time."""

    def __init__(self, held_up_at_s: float) -> None:
        self._held_up_at_s = LoopClock().now_s() + held_up_at_s

    def now_s(self) -> float:
        now_s = LoopClock().now_s()
        return now_s + 0.25 if now_s >= self._held_up_at_s else now_s


def test_a_sample_a_second_with_the_worst_lag_of_that_second():
    """The loop is 0.25 s late once, in the second second: that sample says so, those around it do not."""

    async def scenario() -> list[StatsSampled]:
        bus, clock = Bus(), LateClock(held_up_at_s=1.5)
        samples = bus.subscribe(StatsSampled)
        metrics = Metrics()
        service = StatsService(bus, clock, metrics)
        metrics.gauge("loop_lag_s", "The worst lag.", lambda: service.lag_s)
        task = asyncio.create_task(service.run())
        await asyncio.sleep(3.05)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert service.sample().figures["loop_lag_s"] == pytest.approx(0.0, abs=1e-6)
        return [samples.take_event() for _ in range(len(samples))]

    lags = [sample.figures["loop_lag_s"] for sample in run_virtual(scenario())]
    assert lags == pytest.approx([0.0, 0.25, 0.0], abs=1e-6)
