"""The plots of the tuning screen: a panel a quantity, a colour a wheel."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import TypeVar

from textual_hires_canvas import HiResMode
from textual_plot import NumericAxisFormatter, PlotWidget

from chefbotd.cli.trace import Curve, WheelTrace

T = TypeVar("T")

SHOWN_S = 8.0
COLOURS = ("green", "cyan", "magenta", "yellow", "blue", "red")
TARGET_COLOUR = "bright_black"


@dataclass(frozen=True, slots=True)
class Panel:
    """A quantity: its name, its curve, what that is compared with, its share of the height, its axis's least span."""

    title: str
    curve: Callable[[WheelTrace], Curve]
    reference: Callable[[WheelTrace], Curve] | None
    height: str
    least_span: float


class TickLabels(NumericAxisFormatter):
    """Numbers, of which zero has no sign."""

    def get_labels_for_ticks(self, ticks: Sequence[float]) -> list[str]:
        """Textual's plot: the text of each tick."""
        labels: list[str] = super().get_labels_for_ticks(ticks)
        return [label.removeprefix("-") if float(label) == 0.0 else label for label in labels]


PANELS = (
    Panel("speed, rad/s", lambda trace: trace.speed_rad_s, lambda trace: trace.target_rad_s, "4fr", 1.0),
    Panel("error, rad/s", lambda trace: trace.error_rad_s, None, "3fr", 1.0),
    Panel("duty", lambda trace: trace.duty, None, "3fr", 20.0),
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
        self.set_y_formatter(TickLabels())

    def show(self, traces: Sequence[WheelTrace]) -> None:
        """Draw these wheels."""
        self.clear()
        drawn: list[Curve] = []
        for trace, colour in coloured(traces):
            if self._panel.reference is not None:
                self._draw(trace, self._panel.reference(trace), TARGET_COLOUR, drawn)
            self._draw(trace, self._panel.curve(trace), colour, drawn)
        self.set_ylimits(*span(drawn, self._panel.least_span))

    def _draw(self, trace: WheelTrace, curve: Curve, colour: str, drawn: list[Curve]) -> None:
        self.plot(trace.age_s, curve, colour, HiResMode.BRAILLE)
        drawn.append(curve)


def span(curves: Sequence[Curve], least: float) -> tuple[float, float]:
    """The ends of an axis that holds the curves and spans no less than ``least``, what is left on both sides."""
    values = [float(bound) for curve in curves if curve.size for bound in (curve.min(), curve.max())] or [0.0]
    lowest, highest = min(values), max(values)
    margin = max(0.0, least - (highest - lowest)) / 2
    return lowest - margin, highest + margin


def coloured(wheels: Sequence[T]) -> Iterator[tuple[T, str]]:
    """Every wheel with its colour; where there are more wheels than colours, the colours come again."""
    return zip(wheels, cycle(COLOURS), strict=False)
