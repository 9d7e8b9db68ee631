"""What strangers' components bring to chefbotctl: commands, and rows of its status. They run with its user's rights."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import click

from chefbotd.cli.common.echo import tell
from chefbotd.component import Component, StatusRow, resolve

GROUP = "chefbotd.components"


def strangers_rows(plugins: Sequence[Mapping[str, Any]]) -> list[StatusRow]:
    """The rows of the components that run in the daemon, where their packages are installed here too."""
    running = [str(plugin["name"]) for plugin in plugins if not plugin["reason"]]
    return [row for name in running for component in _components(name=name) for row in component.status]


def strangers_commands() -> dict[str, str]:
    """The commands of every installed component, by name, each with its reference; called where no own one fits."""
    return {name: reference for component in _components() for name, reference in component.commands.items()}


def strangers_command(name: str, reference: str) -> click.Command | None:
    """The command; None where it cannot be loaded, which is said."""
    try:
        command = resolve(reference)
        if not isinstance(command, click.Command):
            raise TypeError(f"expected a command of click, got {command!r}")
    except Exception as error:  # noqa: BLE001 - somebody else's code, and it is told
        tell(f"The command {name!r} of an installed component is left out: {type(error).__name__}: {error}")
        return None
    return command


def _components(name: str | None = None) -> Iterator[Component]:
    """Those of this name, or all; one that cannot be loaded is said and left out."""
    from importlib.metadata import entry_points  # slow to import

    offered = entry_points(group=GROUP)
    for entry in offered if name is None else offered.select(name=name):
        try:
            component = entry.load()
        except Exception as error:  # noqa: BLE001 - somebody else's code, and it is told
            tell(f"The component {entry.name!r} is left out: {type(error).__name__}: {error}")
            continue
        if isinstance(component, Component):
            yield component
