"""The console on which tables and progress are drawn."""

from rich.console import Console


class Printer(Console):
    """rich's console without its own exit when the output is closed: the program decides."""

    @property
    def draws_color(self) -> bool:
        """Whether a picture may tell by colors alone: a terminal that has them, and nobody has said NO_COLOR."""
        return self.is_terminal and self.color_system is not None and not self.no_color

    @property
    def redraws(self) -> bool:
        """Whether a picture can be drawn over the one before."""
        return self.is_terminal and not self.is_dumb_terminal

    def on_broken_pipe(self) -> None:
        """rich: a write has just failed. Raise the error; rich itself would end the program."""
        raise
