"""The one list of our own components; each is declared in ``chefbotd/components/NAME/component.py``."""

from collections.abc import Iterator
from functools import cache
from typing import Final

from chefbotd.component import Component, resolve

FIRST: Final = ("recording", "foxglove")
"""Those that take an event before any other part, so that they see it before what follows from it."""

OWN: Final = (
    "localization",
    "navigation",
    "mapping",
    "worker",
    "maps",
    "depth_camera",
    "tuning",
    "statistics",
    "agents",
    "calibration",
    "simulation",
    "doctor",
    "flash",
    "discovery",
)
"""The others, in the order in which they are built."""


@cache
def own_component(name: str) -> Component:
    """The declaration, which loads nothing of what it names."""
    component: Component = resolve(f"chefbotd.components.{name}.component:COMPONENT")
    return component


def own_components() -> Iterator[Component]:
    """Every component of ours."""
    for name in (*FIRST, *OWN):
        yield own_component(name)
