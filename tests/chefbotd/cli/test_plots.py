"""The tuning screen's plots: what their axes span, how ticks read, and which colour is which wheel's."""

import numpy as np
import pytest

from chefbotd.cli.plots import COLOURS, TickLabels, coloured, span


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


def test_no_wheel_is_left_out_for_want_of_a_colour() -> None:
    """One wheel more than there are colours: it has the first one's."""
    wheels = [f"wheel_{number}" for number in range(len(COLOURS) + 1)]
    assert list(coloured(wheels)) == [*zip(wheels[:-1], COLOURS, strict=True), (wheels[-1], COLOURS[0])]
