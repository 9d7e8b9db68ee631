"""Publishes the daemon's figures and the lag of the event loop once a second."""

from msgspec.structs import replace

from chefbotd.bus import Bus
from chefbotd.clock import Clock, next_beat
from chefbotd.components.statistics.models import StatsData, stats_data, stats_model, topics
from chefbotd.core.events import StatsSampled
from chefbotd.features.feature import Feature, Service
from chefbotd.inputs import inputs_of
from chefbotd.metrics import Histogram, Metrics
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import NoParams
from chefbotd.rpc.parameters import Role

PROBE_BEATS, PROBES_PER_SAMPLE = 2, 10
"""The loop's lag is probed ten times a second, and a sample is taken once a second."""

LAG_BOUNDS_S = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.25, 1.0)
"""The watchdog stops the motors at 0.25 s."""


class StatsService:
    """Samples the registry's metrics. ``lag_s`` is the loop's longest lag in the last second; ``lags`` has all lags."""

    def __init__(self, bus: Bus, clock: Clock, metrics: Metrics) -> None:
        self._bus, self._clock, self._metrics = bus, clock, metrics
        self._entries = inputs_of(clock)
        self.lag_s, self.lags = 0.0, Histogram(LAG_BOUNDS_S)

    def sample(self) -> StatsSampled:
        """The present values."""
        return StatsSampled(self._clock.now_s(), self._metrics.collect())

    @method(role=Role.OBSERVE)
    def get_stats(self, caller: Caller, params: NoParams) -> StatsData:
        """The present values of the daemon's counters."""
        return stats_data(self.sample())

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


def statistics(service: StatsService, metrics: Metrics, clock: Clock) -> Feature:
    """The feature for the registry's metrics; the uptime counts from this call."""
    started_s, model = clock.now_s(), stats_model(metrics)

    def add_metrics(metrics: Metrics) -> None:
        metrics.gauge("uptime_s", "Time since the daemon started.", lambda: clock.now_s() - started_s)
        metrics.gauge(
            "loop_lag_s",
            "The longest delay of a timer of the event loop in the last second.",
            lambda: service.lag_s,
        )
        metrics.histogram("loop_lags_s", "The delay of the event loop's timers.", service.lags)

    return Feature(
        "statistics",
        services=(Service("stats", service.run),),
        methods=tuple(replace(row, result=model) for row in methods_of(service)),
        topics=topics(model),
        not_replayed=("get_stats",),
        add_metrics=add_metrics,
    )
