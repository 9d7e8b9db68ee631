"""``status --watch``: shows the whole state in the terminal and updates it in place, with rich."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from rich.console import Group, RenderableType
from rich.live import Live
from rich.text import Text

from chefbotd.cli.common import output
from chefbotd.cli.common.console import Printer

Show = Callable[[Mapping[str, Any] | None, str], None]


@contextmanager
def board() -> Iterator[Show]:
    """Shows a state, and what keeps it from being newer."""
    with Live(console=Printer(highlight=False), auto_refresh=False) as live:
        yield lambda state, trouble: live.update(drawn(state, trouble), refresh=True)


def drawn(state: Mapping[str, Any] | None, trouble: str) -> RenderableType:
    """The table of the state, and a line below it."""
    below = Text(trouble, style="bold red") if trouble else Text("Ctrl-C ends this.", style="dim")
    return Group(below) if state is None else Group(output.status_table(state), below)
