"""What the component for the simulated robot offers to the daemon that drives it."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, StatusRow

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature


def build(context: "Context[None]") -> "list[Feature]":
    """The topic with the truth, which only a simulated robot has."""
    if not context.parts.context.simulated:
        return []
    from chefbotd.components.simulation.models import TOPICS
    from chefbotd.features.feature import Feature

    return [Feature("simulation", topics=TOPICS)]


COMPONENT = Component(
    name="simulation",
    api=API_VERSION,
    build=build,
    status=(
        StatusRow("sim", "chefbotd.components.simulation.status_text:truth", after="recording", ages=True),
    ),
)
