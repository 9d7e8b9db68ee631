"""Statistics: the daemon's figures on request and once a second."""

from collections.abc import Mapping
from functools import cache
from typing import Any, Protocol

from pydantic import Field, create_model

from chefbotd.core.events import StatsSampled
from chefbotd.metrics import Metrics
from chefbotd.rpc.method import Caller, method
from chefbotd.rpc.models import NoParams, TopicData, UnknownData
from chefbotd.rpc.roles import Role
from chefbotd.rpc.topics import Topic


class StatsData(UnknownData):
    """Counters since the daemon started, and the worst of the last second.

    Each figure of the daemon's registry is an attribute; ``describe`` says which there are.
    """


def stats_model(metrics: Metrics) -> type[StatsData]:
    """``StatsData`` with the schema of what is in the registry by the time that somebody asks for the schema."""

    class RegisteredStatsData(StatsData):
        __doc__ = StatsData.__doc__

        @classmethod
        def model_json_schema(cls, *args: Any, **options: Any) -> dict[str, Any]:
            return _schema(tuple((metric.name, metric.annotation, metric.help) for metric in metrics))

    return RegisteredStatsData


@cache
def _schema(figures: tuple[tuple[str, Any, str], ...]) -> dict[str, Any]:
    fields: dict[str, Any] = {name: (kind, Field(description=told)) for name, kind, told in figures}
    model = create_model("StatsData", __base__=TopicData, __doc__=StatsData.__doc__, **fields)
    return model.model_json_schema(mode="serialization")


class Statistics(Protocol):
    """What samples the figures."""

    def sample(self) -> StatsSampled:
        """The figures as they stand."""
        ...


class StatisticsMethods:
    """The methods of this feature."""

    def __init__(self, statistics: Statistics) -> None:
        self._statistics = statistics

    @method(role=Role.OBSERVE)
    def get_stats(self, caller: Caller, params: NoParams) -> StatsData:
        """The present values of the daemon's counters."""
        return stats_data(self._statistics.sample())


def stats_data(event: StatsSampled) -> StatsData:
    """The figures as a client reads them."""
    figures: Mapping[str, Any] = event.figures
    return StatsData(**figures)


def topics(model: type[StatsData]) -> tuple[Topic, ...]:
    """The topic ``stats``, with its model."""
    return (Topic("stats", (StatsSampled,), model, stats_data),)
