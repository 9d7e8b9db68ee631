"""What the component for making maps offers."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, StatusRow
from chefbotd.components.maps.component import makes_maps

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature


def build(context: "Context[None]") -> "Feature":
    """Makes maps in the worker, of the lidars' scans."""
    from chefbotd.components.mapping.build import mapping_of

    return mapping_of(context)


COMPONENT = Component(
    name="mapping",
    api=API_VERSION,
    build=build,
    is_enabled=lambda section, settings: makes_maps(settings),
    skills={"mapping": "chefbotd.components.mapping.skill:MappingSkill"},
    status=(StatusRow("mapping", "chefbotd.components.mapping.status_text:mapping", after="navigation"),),
)
