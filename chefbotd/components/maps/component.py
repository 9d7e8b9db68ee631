"""What the component for stored maps offers."""

from typing import TYPE_CHECKING, Any

from chefbotd.component import API_VERSION, Component

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature


def makes_maps(settings: Any) -> bool:
    """Whether the robot has what maps are made of: a lidar, and the worker."""
    return bool(settings.lidar) and settings.worker.enabled


def build(context: "Context[None]") -> "Feature":
    """Keeps maps in a folder, with their places and earlier versions."""
    from chefbotd.components.maps.build import maps_of

    return maps_of(context, makes_maps=makes_maps(context.settings))


COMPONENT = Component(
    name="maps",
    api=API_VERSION,
    build=build,
    is_enabled=lambda section, settings: settings.maps is not None or makes_maps(settings),
    commands={
        "map": "chefbotd.components.maps.cli.commands:map_group",
        "places": "chefbotd.components.maps.cli.places:places",
    },
)
