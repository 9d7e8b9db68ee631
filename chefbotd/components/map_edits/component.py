"""What the component for edits of maps offers."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, PagePart
from chefbotd.components.maps.component import keeps_maps

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature


def build(context: "Context[None]") -> "Feature":
    """Keeps edits beside the stored maps, and has maps sent with them."""
    from chefbotd.components.map_edits.service import MapEditsService, map_edits
    from chefbotd.components.maps.service import MapsService

    return map_edits(MapEditsService(context.bus, context.clock, context.of("maps", MapsService)))


COMPONENT = Component(
    name="map_edits",
    api=API_VERSION,
    build=build,
    is_enabled=keeps_maps,
    events=("chefbotd.components.map_edits.events:MapEdited",),
    page=(PagePart("chefbotd.components.map_edits", "page/card.js", panel="map", order=60),),
    commands={"map edit": "chefbotd.components.map_edits.cli:edit"},
    client_methods=("chefbotd.components.map_edits.client_methods:MapEditMethods",),
)
