"""What the component for driving to goals offers."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, PagePart, StatusRow
from chefbotd.components.maps.component import makes_maps

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.components.navigation.parameters import NavigationSection
    from chefbotd.features.feature import Feature

COMMANDS = "chefbotd.components.navigation.cli.commands"


def build(context: "Context[NavigationSection]") -> "list[Feature]":
    """Drives to goals; a robot without the source ``navigation`` only checks its maps."""
    from chefbotd.components.navigation.build import navigation_of

    return navigation_of(context)


COMPONENT = Component(
    name="navigation",
    api=API_VERSION,
    section="chefbotd.components.navigation.parameters:NavigationSection",
    build=build,
    is_enabled=lambda section, settings: makes_maps(settings),
    skills={"navigation": "chefbotd.components.navigation.skill:NavigationSkill"},
    client_methods=("chefbotd.components.navigation.client_methods:NavigationMethods",),
    commands={name: f"{COMMANDS}:{name}" for name in ("go", "home", "dock", "patrol", "where", "localize")},
    page=(PagePart("chefbotd.components.navigation", "page/card.js", panel="goals"),),
    status=(
        StatusRow(
            "navigation", "chefbotd.components.navigation.status_text:navigation", after="localization"
        ),
    ),
)
