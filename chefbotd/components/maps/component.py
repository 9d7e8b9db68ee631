"""What the component for stored maps offers."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from chefbotd.component import API_VERSION, Component, PagePart, SectionForm

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.components.maps.storage.parameters import MapsParameters
    from chefbotd.features.feature import Feature
    from chefbotd.settings import Settings


def makes_maps(settings: Any) -> bool:
    """Whether the robot has what maps are made of: a lidar, and the worker."""
    return bool(settings.lidar) and settings.worker.enabled


def check_lidars(section: str, lidars: Sequence[str] | None, settings: "Settings") -> Iterator[str]:
    """Each lidar that a section names is configured, and named once."""
    names = [lidar.name for lidar in settings.lidar]
    configured = f"those configured: {', '.join(names)}" if names else "none is configured"
    for number, named in enumerate(lidars or ()):
        if named not in names:
            yield f"{section}.lidars: {named!r} is no lidar ({configured})"
        elif named in (lidars or ())[:number]:
            yield f"{section}.lidars names each lidar once, repeated: {named!r}"


def build(context: "Context[MapsParameters | None]") -> "Feature":
    """Keeps maps in a folder, with their places and earlier versions."""
    from chefbotd.components.maps.build import maps_of

    return maps_of(context, makes_maps=makes_maps(context.settings))


def keeps_maps(section: object, settings: Any) -> bool:
    """Whether this robot keeps maps: what stands beside them is enabled then."""
    return COMPONENT.is_enabled(getattr(settings, "maps", None), settings)


COMPONENT = Component(
    name="maps",
    api=API_VERSION,
    section="chefbotd.components.maps.storage.parameters:MapsParameters",
    form=SectionForm.OPTIONAL,
    paths=("folder",),
    build=build,
    is_enabled=lambda section, settings: section is not None or makes_maps(settings),
    exclusive=True,
    fixed=True,
    client_methods=("chefbotd.components.maps.client_methods:MapMethods",),
    page=(PagePart("chefbotd.components.maps", "page/card.js", panel="map", order=40),),
    commands={
        "map": "chefbotd.components.maps.cli.commands:map_group",
        "places": "chefbotd.components.maps.cli.places:places",
    },
)
