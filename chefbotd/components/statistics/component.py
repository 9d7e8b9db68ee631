"""What the component for statistics offers to the daemon."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature


def build(context: "Context[None]") -> "Feature":
    """Offers the figures of all parts."""
    from chefbotd.components.statistics.service import StatsService, statistics

    metrics = context.parts.metrics
    return statistics(StatsService(context.bus, context.clock, metrics), metrics, context.clock)


COMPONENT = Component(name="statistics", api=API_VERSION, build=build)
