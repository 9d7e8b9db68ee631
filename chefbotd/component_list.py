"""The one list of our own components; each is declared in ``chefbotd/components/NAME/component.py``."""

from collections.abc import Iterator
from functools import cache
from typing import Final

from chefbotd.component import Component, resolve

OWN: Final[tuple[str, ...]] = ()
"""In the order in which they are built: what records an event, or takes one first, stands before others."""


@cache
def own_component(name: str) -> Component:
    """The declaration, which loads nothing of what it names."""
    component: Component = resolve(f"chefbotd.components.{name}.component:COMPONENT")
    return component


def own_components() -> Iterator[Component]:
    """Every component of ours."""
    for name in OWN:
        yield own_component(name)
