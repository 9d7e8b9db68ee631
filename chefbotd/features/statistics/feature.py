"""The feature: statistics, of whatever all parts have added to the registry."""

from msgspec.structs import replace

from chefbotd.clock import Clock
from chefbotd.features.feature import Feature, Service
from chefbotd.features.statistics.methods import Statistics, StatisticsMethods, stats_model, topics
from chefbotd.features.statistics.service import StatsService
from chefbotd.metrics import Metrics
from chefbotd.rpc.method import methods_of


def statistics(service: StatsService, metrics: Metrics, clock: Clock) -> Feature:
    """The registry's figures, over the service that samples them; the uptime counts from this call."""
    started_s = clock.now_s()

    def add_metrics(metrics: Metrics) -> None:
        metrics.gauge("uptime_s", "Time since the daemon started.", lambda: clock.now_s() - started_s)
        metrics.gauge(
            "loop_lag_s",
            "The longest delay of a timer of the event loop in the last second.",
            lambda: service.lag_s,
        )
        metrics.histogram("loop_lags_s", "The delay of the event loop's timers.", service.lags)

    return replace(
        statistics_without_service(service, metrics),
        services=(Service("stats", service.run),),
        add_metrics=add_metrics,
    )


def statistics_without_service(source: Statistics, metrics: Metrics) -> Feature:
    """The method and the topic, over anything that samples the registry's figures."""
    model = stats_model(metrics)
    methods = tuple(replace(each, result=model) for each in methods_of(StatisticsMethods(source)))
    return Feature("statistics", methods=methods, topics=topics(model))
