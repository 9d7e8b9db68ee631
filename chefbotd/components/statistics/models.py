"""Statistics: the daemon's figures on request and once a second."""

from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any

from msgspec import Meta, defstruct

from chefbotd.core.events import StatsSampled
from chefbotd.metrics import Metrics
from chefbotd.rpc.encoding import UnknownData, schema
from chefbotd.rpc.topics import Topic


class StatsData(UnknownData):
    """Counters since the daemon started, and the worst of the last second.

    Each metric of the daemon's registry is an attribute; ``describe`` lists them.
    """


def stats_model(metrics: Metrics) -> type[StatsData]:
    """``StatsData`` whose schema has the metrics that are registered when the schema is requested."""

    class RegisteredStatsData(StatsData):
        __doc__ = StatsData.__doc__

        @classmethod
        def schema(cls) -> dict[str, Any]:
            return _schema(tuple((metric.name, metric.annotation, metric.help) for metric in metrics))

    return RegisteredStatsData


@cache
def _schema(figures: tuple[tuple[str, Any, str], ...]) -> dict[str, Any]:
    fields = [(name, Annotated[kind, Meta(description=purpose)]) for name, kind, purpose in figures]
    return schema(defstruct("StatsData", fields, namespace={"__doc__": StatsData.__doc__}))


def stats_data(event: StatsSampled) -> StatsData:
    """The figures as a client reads them."""
    figures: Mapping[str, Any] = event.figures
    return StatsData(**figures)


def topics(model: type[StatsData]) -> tuple[Topic, ...]:
    """The topic ``stats``, with its model."""
    return (Topic("stats", (StatsSampled,), model, stats_data),)
