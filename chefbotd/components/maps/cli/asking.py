"""Requests of the map commands to the daemon, with an error if it keeps no maps; writes files whole."""

from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import Client
from chefbotd.client.wire import ProgressListener
from chefbotd.storage import replace_file

T = TypeVar("T")


def ask(context: CommandContext, action: Callable[[Client], Awaitable[T]]) -> T:
    """Run ``action`` with a connected client.

    Raises:
        ProgramError: any failure, with its exit code.
    """
    absent = "this daemon keeps no maps: its configuration has no section [maps]"
    return context.run_with_client(action, absent=absent)


def write_file(path: Path, data: bytes, *, force: bool) -> None:
    """Write a file, whole or not at all; one that exists only by ``force``.

    Raises:
        ProgramError: it exists, or cannot be written.
    """
    if path.exists() and not force:
        raise ProgramError(Exit.FAILED, f"{path} exists already; --force replaces it")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, data)
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"cannot write {path}: {error.strerror}") from error


@contextmanager
def progress_bar(doing: str, *, quiet: bool = False) -> Iterator[ProgressListener]:
    """Draw what the listener is told, where there is a terminal; it is gone when the block ends."""
    from chefbotd.cli.common.console import Printer

    console = Printer(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda done, total, text: None
        return
    from rich.progress import BarColumn, Progress, TextColumn

    with Progress(
        TextColumn("{task.description}"), BarColumn(), console=console, transient=True, auto_refresh=False
    ) as bar:
        task = bar.add_task(doing)

        def show(done: float, total: float, text: str) -> None:
            bar.update(task, completed=done, total=total, description=f"{doing}: {text}", refresh=True)

        yield show
