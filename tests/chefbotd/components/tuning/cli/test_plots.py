"""The tuning screen's plots: what their axes span, how ticks read, and which colour is which wheel's."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chefbotd.components.tuning.cli.plots import COLOURS, Axis, TickLabels, assign_colours, span


@pytest.mark.parametrize(
    ("curves", "spanned"),
    [
        ([], (-0.5, 0.5)),
        ([[]], (-0.5, 0.5)),
        ([[0.0, 0.0]], (-0.5, 0.5)),
        ([[3.0, 3.2], [3.2, 3.4]], (2.7, 3.7)),
        ([[-1.0], [2.0]], (-1.0, 2.0)),
    ],
)
def test_an_axis_spans_the_curves_and_no_less_than_asked(
    curves: list[list[float]], spanned: tuple[float, float]
) -> None:
    """What is at rest or holds a speed is not blown up to fill the plot; what is wider has all the room."""
    assert span([np.array(curve) for curve in curves], least=1.0) == pytest.approx(spanned)


def test_zero_has_no_sign() -> None:
    """A tick that is rounded to zero from below reads as zero, and other ticks keep their sign."""
    assert TickLabels().get_labels_for_ticks([-0.5, -1e-17, 0.5]) == ["-0.5", "0.0", "0.5"]
    assert TickLabels().get_labels_for_ticks([-20.0, 0.0, 20.0]) == ["-20", "0", "20"]


def test_no_wheel_is_left_out_for_want_of_a_colour() -> None:
    """One wheel more than there are colours: it has the first one's."""
    wheels = [f"wheel_{number}" for number in range(len(COLOURS) + 1)]
    assert list(assign_colours(wheels)) == [*zip(wheels[:-1], COLOURS, strict=True), (wheels[-1], COLOURS[0])]


@pytest.mark.parametrize(
    ("lowest", "highest", "rows", "ticks", "ends"),
    [
        (-2.22, 2.22, 11, [-2.0, -1.0, 0.0, 1.0, 2.0], (-2.75, 2.75)),  # 2 rows a tick: 0.5 a row
        (-1.9, 2.1, 7, [-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0], (-3.5, 3.5)),
        (5.15, 5.85, 4, [5.2, 5.4, 5.6, 5.8], (5.1, 5.9)),
        (-70.0, 85.0, 3, [-100.0, 0.0, 100.0], (-150.0, 150.0)),
    ],
)
def test_ticks_are_equally_far_apart(
    lowest: float, highest: float, rows: int, ticks: list[float], ends: tuple[float, float]
) -> None:
    """By hand: as many rows from each to the next, each in the middle of its row, and all values within the ends."""
    axis = Axis.over(lowest, highest, rows=rows)
    assert axis.ticks == pytest.approx(ticks)
    assert (axis.lowest, axis.highest) == pytest.approx(ends)


@given(st.floats(-1000, 1000), st.floats(0.01, 1000), st.integers(1, 60))
def test_an_axis_has_a_row_for_every_value_and_ticks_on_whole_rows(
    lowest: float, width: float, rows: int
) -> None:
    """Whatever is shown in whatever height: it holds the values, and no two ticks share a row."""
    axis = Axis.over(lowest, lowest + width, rows=rows)
    a_row = (axis.highest - axis.lowest) / rows
    assert axis.lowest <= lowest + 1e-9
    assert lowest + width <= axis.highest + 1e-9
    places = [(tick - axis.lowest) / a_row for tick in axis.ticks]
    assert [place % 1 for place in places] == pytest.approx([0.5] * len(places), abs=1e-3)
    apart = {round(b - a) for a, b in pairwise(places)}
    assert len(apart) <= 1
    assert 0 not in apart


def test_a_panel_that_is_not_laid_out_yet() -> None:
    """No rows, no ticks."""
    assert Axis.over(-1.0, 2.0, rows=0) == Axis(-1.0, 2.0, [])
