"""Monotone interpolation."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.sensing.infrared import MonotoneCurve
from tests.budget import examples


def test_slopes_and_values_are_those_computed_by_hand() -> None:
    """Rises 1 and 3 of width 1: slopes (3 - 3) / 2 = 0, 6 / (3/1 + 3/3) = 1.5 and (9 - 1) / 2 = 4.

    Half-way up the first part: 0.5 * 0 + 0.5 * 1 + 0.125 * (0 - 1.5) = 0.3125; up the second: 2.5 + 0.125 * (1.5 - 4) =
    2.1875.
    """
    curve = MonotoneCurve([(0, 0), (1, 1), (2, 4)])
    assert [curve.value_at(x) for x in (0.5, 1.5)] == pytest.approx([0.3125, 2.1875])


def test_two_points_are_a_line() -> None:
    """There is nothing to bend it."""
    assert MonotoneCurve([(1, 10), (3, 4)]).value_at(2.5) == pytest.approx(5.5)


def test_beyond_its_ends_it_is_flat() -> None:
    """The nearest end's value, on both sides."""
    curve = MonotoneCurve([(1, 10), (3, 4)])
    assert (curve.value_at(0), curve.value_at(9)) == (10, 4)


def test_an_end_that_would_overshoot_is_held() -> None:
    """Rises 1 and -9: the end's estimate (3 + 9) / 2 = 6 is cut to 3 times the rise; the peak itself is level.

    A quarter in: 0.25 * 0.75^2 * 3 + 0.25^2 * (3 - 0.5) * 1 = 0.578125.
    """
    assert MonotoneCurve([(0, 0), (1, 1), (2, -8)]).value_at(0.25) == pytest.approx(0.578125)


@pytest.mark.parametrize("points", [[], [(1, 1)], [(1, 1), (1, 2)], [(2, 1), (1, 2)]])
def test_points_that_make_no_curve_are_refused(points: list[tuple[float, float]]) -> None:
    """Too few, or x that does not grow."""
    with pytest.raises(ValueError, match="two points or more with increasing x"):
        MonotoneCurve(points)


@settings(max_examples=examples(100))
@given(st.lists(st.tuples(st.floats(0.01, 10), st.floats(0, 10)), min_size=2, max_size=8))
def test_rising_points_make_a_rising_curve_through_them(steps: list[tuple[float, float]]) -> None:
    """Between points that never fall the curve never falls, and it passes through each of them."""
    points = [(0.0, 0.0)]
    for width, rise in steps:
        points.append((points[-1][0] + width, points[-1][1] + rise))
    curve = MonotoneCurve(points)
    assert [curve.value_at(x) for x, _ in points] == pytest.approx([y for _, y in points])
    end = points[-1][0]
    values = [curve.value_at(end * k / 200) for k in range(201)]
    assert all(after >= before - 1e-9 for before, after in pairwise(values))
