"""A progress bar on stderr for requests that take their time."""

from collections.abc import Iterator
from contextlib import contextmanager

from chefbotd.client.wire import ProgressListener


@contextmanager
def progress_bar(doing: str, *, quiet: bool = False) -> Iterator[ProgressListener]:
    """Draw what the listener is told, where there is a terminal; it is gone when the block ends."""
    from rich.console import Console

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield _show_nothing
        return
    from rich.progress import BarColumn, Progress, TextColumn

    with Progress(
        TextColumn("{task.description}"), BarColumn(), console=console, transient=True, auto_refresh=False
    ) as bar:
        task = bar.add_task(doing)

        def show(done: float, total: float, text: str) -> None:
            bar.update(task, completed=done, total=total, description=f"{doing}: {text}", refresh=True)

        yield show


def _show_nothing(_done: float, _total: float, _text: str) -> None:
    """Nobody looks."""
