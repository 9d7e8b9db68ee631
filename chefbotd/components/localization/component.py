"""What the component for localization offers."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, StatusRow
from chefbotd.components.maps.component import makes_maps

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature


def build(context: "Context[None]") -> "Feature":
    """Finds the robot on the map in use, in the worker."""
    from chefbotd.components.localization.build import localization_of

    return localization_of(context)


COMPONENT = Component(
    name="localization",
    api=API_VERSION,
    build=build,
    is_enabled=lambda section, settings: makes_maps(settings),
    skills={"localization": "chefbotd.components.localization.skill:LocalizationSkill"},
    status=(
        StatusRow(
            "localization", "chefbotd.components.localization.status_text:localization", after="battery"
        ),
    ),
)
