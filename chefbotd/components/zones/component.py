"""What the component for zones offers."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, PagePart
from chefbotd.components.maps.component import keeps_maps

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature


def build(context: "Context[None]") -> "Feature":
    """Keeps zones beside the stored maps."""
    from chefbotd.components.maps.service import MapsService
    from chefbotd.components.zones.service import ZonesService, zones

    return zones(ZonesService(context.bus, context.clock, context.of("maps", MapsService)))


COMPONENT = Component(
    name="zones",
    api=API_VERSION,
    build=build,
    is_enabled=keeps_maps,
    events=("chefbotd.components.zones.events:ZonesChanged",),
    client_methods=("chefbotd.components.zones.client_methods:ZoneMethods",),
    page=(PagePart("chefbotd.components.zones", "page/card.js", panel="map", order=50),),
    commands={"zones": "chefbotd.components.zones.cli:zones"},
)
