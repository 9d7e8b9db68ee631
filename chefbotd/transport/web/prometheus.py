"""The daemon's figures in Prometheus' text format."""

from collections.abc import Iterator, Mapping
from itertools import accumulate
from typing import cast

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.metrics_core import Metric as Family
from prometheus_client.registry import Collector

from chefbotd.metrics import Histogram, Kind, Metric, Metrics

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"


class MetricsCollector:
    """Reads every figure when it is asked; one that is not known yet has no sample."""

    def __init__(self, metrics: Metrics) -> None:
        self._metrics = metrics

    def collect(self) -> Iterator[Family]:
        """A family for each figure; counters end in ``_total``, as the format wants it."""
        for metric in self._metrics:
            yield _family(metric)


def _family(metric: Metric) -> Family:
    value = metric.read()
    if isinstance(value, Histogram):
        return _histogram(metric, value)
    make = CounterMetricFamily if metric.kind is Kind.COUNTER else GaugeMetricFamily
    family = make(f"chefbotd_{metric.name}", metric.help, labels=[metric.label] if metric.label else [])
    if isinstance(value, Mapping):
        for key, count in value.items():
            family.add_metric([str(key)], count)
    elif value is not None:
        family.add_metric([], value)
    return family


def _histogram(metric: Metric, histogram: Histogram) -> Family:
    """Prometheus' buckets are cumulative, and the last has no bound."""
    bounds = [*map(str, histogram.bounds), "+Inf"]
    buckets = list(zip(bounds, accumulate(histogram.counts), strict=True))
    return HistogramMetricFamily(
        f"chefbotd_{metric.name}", metric.help, buckets=buckets, sum_value=histogram.total
    )


def exposition(metrics: Metrics) -> bytes:
    """All figures as text."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(cast(Collector, MetricsCollector(metrics)))
    text: bytes = generate_latest(registry)
    return text
