"""The console on which tables and progress are drawn."""

from rich.console import Console


class Printer(Console):
    """rich's console without its own exit when the output is closed: the program decides."""

    def on_broken_pipe(self) -> None:
        """rich: a write has just failed. Raise the error; rich itself would end the program."""
        raise
