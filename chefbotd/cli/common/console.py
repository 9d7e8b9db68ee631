"""The console on which tables and progress are drawn."""

from rich.console import Console


class Printer(Console):
    """rich's console, but what becomes of a program whose output was closed is left to the program."""

    def on_broken_pipe(self) -> None:
        """rich: a write has just failed, which is passed on; rich itself would end the program."""
        raise
