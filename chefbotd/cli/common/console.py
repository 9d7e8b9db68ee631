"""The console on which tables and progress are drawn."""

from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from chefbotd.core.printable import plain


class Printer(Console):
    """rich's console without its own exit when the output is closed: the program decides.

    Of what it draws, a terminal takes nothing for a command but what rich itself means as one.
    """

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """rich: the pieces that are written."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(plain(segment.text), segment.style)

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
