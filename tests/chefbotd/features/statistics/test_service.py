"""The statistics, once a second."""

import asyncio
import dataclasses

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.events import StatsSampled
from chefbotd.features.statistics.service import StatsService

EMPTY = StatsSampled(
    stamp_s=0.0,
    uptime_s=0.0,
    frames={},
    refused={},
    lines_out=0,
    setpoints_replaced=0,
    link_opens=0,
    board_restarts=0,
    encoder_readings_refused=0,
    control_steps=0,
    bus_dropped={},
    clients=0,
    telemetry_dropped=0,
    loop_lag_s=0.0,
    board_clock_skew_ppm=None,
    board_clock_jitter_s=None,
)


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
        service = StatsService(
            bus, clock, lambda stamp_s, lag_s: dataclasses.replace(EMPTY, stamp_s=stamp_s, loop_lag_s=lag_s)
        )
        task = asyncio.create_task(service.run())
        await asyncio.sleep(3.05)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert service.sample().loop_lag_s == pytest.approx(0.0, abs=1e-6)
        return [samples.take() for _ in range(len(samples))]

    lags = [sample.loop_lag_s for sample in run_virtual(scenario())]
    assert lags == pytest.approx([0.0, 0.25, 0.0], abs=1e-6)
