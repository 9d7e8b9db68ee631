"""The one list of our own components; each is declared in ``chefbotd/components/NAME/component.py``."""

from collections.abc import Iterator
from functools import cache
from typing import Final

from chefbotd.component import Component, resolve

FIRST: Final = ("recording", "foxglove")
"""Those that take an event before any other part, so that they see it before what follows from it."""

SCANNING: Final = (
    "maps",
    "map_edits",
    "zones",
    "worker",
    "mapping",
    "localization",
    "navigation",
    "depth_camera",
)
"""What is made of scans, and what makes them: each takes an event before what every robot has."""

OWN: Final = (
    "tuning",
    "statistics",
    "agents",
    "calibration",
    "simulation",
    "discovery",
    "notifications",
    "invitations",
    "camera",
    "plot",
)
"""The others; of each of the three, in the order in which they are built."""

COMMANDS: Final = ("doctor", "flash", "new_robot")
"""What has commands alone: no daemon loads it."""


@cache
def own_component(name: str) -> Component:
    """The declaration, which loads nothing of what it names."""
    component: Component = resolve(f"chefbotd.components.{name}.component:COMPONENT")
    return component


def own_components() -> Iterator[Component]:
    """Every component of ours that a daemon may have."""
    for name in (*FIRST, *SCANNING, *OWN):
        yield own_component(name)


def components_with_commands() -> Iterator[Component]:
    """Every component of ours, also those with commands alone."""
    yield from own_components()
    for name in COMMANDS:
        yield own_component(name)
