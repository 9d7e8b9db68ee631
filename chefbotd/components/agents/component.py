"""What the component for agents offers to the daemon."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, PagePart

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature


def build(context: "Context[None]") -> "Feature":
    """Offers agents."""
    from chefbotd.components.agents.service import agents

    return agents(context.bus, context.clock)


COMPONENT = Component(
    name="agents",
    api=API_VERSION,
    build=build,
    page=(PagePart("chefbotd.components.agents", "card.js", panel="programs", for_guests=True),),
)
