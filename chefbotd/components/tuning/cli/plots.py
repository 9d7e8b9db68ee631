"""The plots of the tuning screen: one panel per quantity, one colour per wheel."""

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import count, cycle, pairwise
from typing import Any, Self, TypeVar

import numpy as np
import numpy.typing as npt
from textual_hires_canvas import HiResMode
from textual_plot import NumericAxisFormatter, PlotWidget

from chefbotd.core.record import Record

Curve = npt.NDArray[np.float64]


class WheelTrace(Record, frozen=True):
    """One wheel's samples; ``age_s`` is 0 for the newest and negative before."""

    age_s: Curve
    target_rad_s: Curve
    speed_rad_s: Curve
    duty: Curve

    @property
    def error_rad_s(self) -> Curve:
        """Target minus measured speed."""
        return self.target_rad_s - self.speed_rad_s

    def rms_error_rad_s(self) -> float:
        """The root of the mean square of the error; zero before the first sample."""
        return float(np.sqrt(np.mean(self.error_rad_s**2))) if self.age_s.size else 0.0


class Trace:
    """The samples of the topic ``wheels`` no older than ``window_s``."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._samples: deque[tuple[float, Mapping[str, Any]]] = deque()

    def add(self, stamp_s: float, data: Mapping[str, Any]) -> None:
        """Add a sample. When time goes back, the daemon was restarted: a new trace begins."""
        if self._samples and stamp_s < self._samples[-1][0]:
            self._samples.clear()
        self._samples.append((stamp_s, data))
        while stamp_s - self._samples[0][0] > self._window_s:
            self._samples.popleft()

    @property
    def wheels(self) -> Sequence[str]:
        """The wheels' names in the robot's order; none before the first sample."""
        return self._samples[-1][1]["name"] if self._samples else ()

    def of(self, wheel: str) -> WheelTrace:
        """One wheel's curves; empty before the first sample.

        Raises:
            ValueError: the samples have no such wheel.
        """
        column = list(self.wheels).index(wheel) if self._samples else 0
        newest_s = self._samples[-1][0] if self._samples else 0.0
        return WheelTrace(
            np.array([stamp_s - newest_s for stamp_s, _ in self._samples]),
            *(
                np.array([data[key][column] for _, data in self._samples], dtype=np.float64)
                for key in ("target_rad_s", "velocity_rad_s", "duty")
            ),
        )


T = TypeVar("T")

SHOWN_S = 8.0
COLOURS = ("green", "cyan", "magenta", "yellow", "blue", "red")
TARGET_COLOUR = "bright_black"
TIME_TICKS_S = [-6.0, -4.0, -2.0, 0.0]
TICKS = 5
"""The approximate number of ticks on a vertical axis."""

ROUNDING = 1e-9


class Panel(Record, frozen=True):
    """A quantity: its name, its curve, what that is compared with, its share of the height, its axis's least span.

    ``has_time`` panels show the time below them.
    """

    title: str
    curve: Callable[[WheelTrace], Curve]
    reference: Callable[[WheelTrace], Curve] | None
    height: str
    least_span: float
    has_time: bool = False


class TickLabels(NumericAxisFormatter):
    """Numbers with as many decimals as needed to tell them apart; zero has no sign."""

    def get_labels_for_ticks(self, ticks: Sequence[float]) -> list[str]:
        """Textual's plot: the text of each tick."""
        step = min((abs(b - a) for a, b in pairwise(ticks)), default=1.0)
        decimals = max(0, -math.floor(math.log10(step) + ROUNDING))
        labels = [f"{tick:.{decimals}f}" for tick in ticks]
        return [label.removeprefix("-") if float(label) == 0.0 else label for label in labels]


class SecondLabels(NumericAxisFormatter):
    """Seconds before now."""

    def get_labels_for_ticks(self, ticks: Sequence[float]) -> list[str]:
        """Textual's plot: the text of each tick."""
        return [f"{tick:g} s" if tick else "now" for tick in ticks]


PANELS = (
    Panel("speed, rad/s", lambda trace: trace.speed_rad_s, lambda trace: trace.target_rad_s, "4fr", 1.0),
    Panel("error, rad/s", lambda trace: trace.error_rad_s, None, "3fr", 1.0),
    Panel("duty", lambda trace: trace.duty, None, "3fr", 20.0, has_time=True),
)


class WheelPlot(PlotWidget, can_focus=False):
    """One panel over the last ``SHOWN_S`` seconds; it takes no keys."""

    def __init__(self, panel: Panel) -> None:
        super().__init__(allow_pan_and_zoom=False)
        self._panel = panel
        self.styles.height = panel.height

    def on_mount(self) -> None:
        """Textual: the widget is there, so lay it out."""
        self.margin_left, self.margin_top, self.margin_bottom = 7, 1, int(self._panel.has_time)
        super().on_mount()
        self.set_ylabel(self._panel.title)
        self.set_xlimits(-SHOWN_S, 0.0)
        self.set_xticks(TIME_TICKS_S if self._panel.has_time else [])
        self.set_x_formatter(SecondLabels())
        self.set_y_formatter(TickLabels())

    def show(self, traces: Sequence[WheelTrace]) -> None:
        """Draw these wheels."""
        self.clear()
        drawn: list[Curve] = []
        for trace, colour in assign_colours(traces):
            if self._panel.reference is not None:
                self._draw_curve(trace, self._panel.reference(trace), TARGET_COLOUR, drawn)
            self._draw_curve(trace, self._panel.curve(trace), colour, drawn)
        axis = Axis.over(*span(drawn, self._panel.least_span), rows=self._scale_rectangle.height)
        self.set_ylimits(axis.lowest, axis.highest)
        self.set_yticks(axis.ticks)

    def _draw_curve(self, trace: WheelTrace, curve: Curve, colour: str, drawn: list[Curve]) -> None:
        self.plot(trace.age_s, curve, colour, HiResMode.BRAILLE)
        drawn.append(curve)


class Axis(Record, frozen=True):
    """The ends of a vertical axis and its ticks, which are a whole number of rows apart."""

    lowest: float
    highest: float
    ticks: list[float]

    @classmethod
    def over(cls, lowest: float, highest: float, *, rows: int) -> Self:
        """An axis from ``lowest`` to ``highest`` on ``rows`` rows of a terminal.

        Ticks are multiples of 1, 2 or 5 times a power of ten, a whole number of rows apart. Each is at the middle of its
        row, as a curve of that value is.
        """
        if rows < 1:  # not laid out yet
            return cls(lowest, highest, [])
        rows_a_tick = max(1, round(rows / TICKS))
        for step in _steps((highest - lowest) / rows * rows_a_tick):
            a_row = step / rows_a_tick
            bottom, top = math.floor(lowest / a_row + 0.5), math.ceil(highest / a_row - 0.5)
            if (spare := rows - (top - bottom + 1)) >= 0:
                break
        bottom, top = bottom - spare // 2, top + (spare - spare // 2)
        ticks = [row * a_row for row in range(bottom, top + 1) if row % rows_a_tick == 0]
        return cls((bottom - 0.5) * a_row, (top + 0.5) * a_row, ticks)


def _steps(least: float) -> Iterator[float]:
    """Distances of ticks from about ``least`` on: 1, 2, 5, 10, 20, ..."""
    for power in count(math.floor(math.log10(least))):
        yield from (digit * 10.0**power for digit in (1, 2, 5))


def span(curves: Sequence[Curve], least: float) -> tuple[float, float]:
    """The ends of an axis for these curves; it spans at least ``least``, with equal margins."""
    values = [float(bound) for curve in curves if curve.size for bound in (curve.min(), curve.max())] or [0.0]
    lowest, highest = min(values), max(values)
    margin = max(0.0, least - (highest - lowest)) / 2
    return lowest - margin, highest + margin


def assign_colours(wheels: Sequence[T]) -> Iterator[tuple[T, str]]:
    """Every wheel with its colour; the colours repeat when there are more wheels."""
    return zip(wheels, cycle(COLOURS), strict=False)
