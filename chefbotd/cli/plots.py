"""The plots of the tuning screen: a panel a quantity, a colour a wheel."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from textual_hires_canvas import HiResMode
from textual_plot import PlotWidget

from chefbotd.cli.trace import Curve, WheelTrace

SHOWN_S = 8.0
COLOURS = ("green", "cyan", "magenta", "yellow", "blue", "red")
TARGET_COLOUR = "bright_black"


@dataclass(frozen=True, slots=True)
class Panel:
    """A quantity: how it is called, which curve it is, what it is compared with, and its share of the height."""

    title: str
    curve: Callable[[WheelTrace], Curve]
    reference: Callable[[WheelTrace], Curve] | None
    height: str


PANELS = (
    Panel("speed, rad/s", lambda trace: trace.speed_rad_s, lambda trace: trace.target_rad_s, "4fr"),
    Panel("error, rad/s", lambda trace: trace.error_rad_s, None, "3fr"),
    Panel("duty", lambda trace: trace.duty, None, "3fr"),
)


class WheelPlot(PlotWidget, can_focus=False):
    """One panel over the last ``SHOWN_S`` seconds; the keys are the screen's."""

    def __init__(self, panel: Panel) -> None:
        super().__init__(allow_pan_and_zoom=False)
        self._panel = panel
        self.styles.height = panel.height

    def on_mount(self) -> None:
        """Textual: the widget is there, so lay it out."""
        self.margin_left, self.margin_top, self.margin_bottom = 7, 1, 0
        super().on_mount()
        self.set_ylabel(self._panel.title)
        self.set_xlimits(-SHOWN_S, 0.0)
        self.set_xticks([])

    def show(self, traces: Sequence[WheelTrace]) -> None:
        """Draw these wheels."""
        self.clear()
        for trace, colour in zip(traces, COLOURS, strict=False):
            if self._panel.reference is not None:
                self.plot(trace.age_s, self._panel.reference(trace), TARGET_COLOUR, HiResMode.BRAILLE)
            self.plot(trace.age_s, self._panel.curve(trace), colour, HiResMode.BRAILLE)
