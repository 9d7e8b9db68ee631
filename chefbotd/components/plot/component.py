"""What the component for plots offers: a card of the page."""

from typing import TYPE_CHECKING, Any

from chefbotd.component import API_VERSION, Component, PagePart

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature


def build(context: "Context[Any]") -> "Feature":
    """Nothing of it runs in the daemon."""
    from chefbotd.features.feature import Feature

    return Feature("plot")


COMPONENT = Component(
    name="plot",
    api=API_VERSION,
    build=build,
    page=(PagePart("chefbotd.components.plot", "card.js", order=30),),
)
