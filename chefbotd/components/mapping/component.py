"""What the component for making maps offers."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, StatusRow
from chefbotd.components.maps.component import check_lidars, makes_maps

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.components.mapping.algorithms.parameters import MappingParameters
    from chefbotd.features.feature import Feature
    from chefbotd.settings import Settings


def build(context: "Context[MappingParameters]") -> "Feature":
    """Makes maps in the worker, of the lidars' scans."""
    from chefbotd.components.mapping.build import mapping_of

    return mapping_of(context)


def check(section: "MappingParameters", settings: "Settings") -> Iterator[str]:
    """The lidars that it names are configured."""
    return check_lidars("mapping", section.lidars, settings)


COMPONENT = Component(
    name="mapping",
    api=API_VERSION,
    section="chefbotd.components.mapping.algorithms.parameters:MappingParameters",
    build=build,
    check=check,
    is_enabled=lambda section, settings: makes_maps(settings),
    skills={"mapping": "chefbotd.components.mapping.skill:MappingSkill"},
    status=(StatusRow("mapping", "chefbotd.components.mapping.status_text:mapping", after="navigation"),),
)
