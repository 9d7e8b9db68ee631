"""What the component for localization offers."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, StatusRow
from chefbotd.components.maps.component import check_lidars, makes_maps

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.components.localization.parameters import LocalizationSection
    from chefbotd.features.feature import Feature
    from chefbotd.settings import Settings


def build(context: "Context[LocalizationSection]") -> "Feature":
    """Finds the robot on the map in use, in the worker."""
    from chefbotd.components.localization.build import localization_of

    return localization_of(context)


def check(section: "LocalizationSection", settings: "Settings") -> Iterator[str]:
    """The lidars that it names are configured."""
    return check_lidars("localization", section.lidars, settings)


COMPONENT = Component(
    name="localization",
    api=API_VERSION,
    section="chefbotd.components.localization.parameters:LocalizationSection",
    build=build,
    check=check,
    is_enabled=lambda section, settings: makes_maps(settings),
    skills={"localization": "chefbotd.components.localization.skill:LocalizationSkill"},
    status=(
        StatusRow(
            "localization", "chefbotd.components.localization.status_text:localization", after="battery"
        ),
    ),
)
