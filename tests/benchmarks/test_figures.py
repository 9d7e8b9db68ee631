"""Percentiles and verdicts."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.figures import Figure, latencies, percentile


@pytest.mark.parametrize(("percent", "expected"), [(0, 1.0), (50, 2.0), (75, 3.0), (76, 4.0), (100, 4.0)])
def test_a_percentile_is_a_value_by_nearest_rank(percent: float, expected: float) -> None:
    """Of four values, ceil(percent / 100 * 4) says which one, the first at least."""
    assert percentile([4.0, 2.0, 1.0, 3.0], percent) == expected


@given(st.lists(st.floats(allow_nan=False), min_size=1, max_size=50), st.floats(0, 100))
def test_at_least_so_many_values_do_not_exceed_a_percentile(values: list[float], percent: float) -> None:
    """That is what the word means."""
    limit = percentile(values, percent)
    assert sum(value <= limit for value in values) >= percent / 100 * len(values)


def test_no_values_have_no_percentile() -> None:
    """It is refused, not made up."""
    with pytest.raises(ValueError, match="no values"):
        percentile([], 50)


@pytest.mark.parametrize(("target", "reached"), [(2.0, True), (1.0, True), (0.5, False), (None, None)])
def test_a_target_is_the_most_that_a_figure_may_be(target: float | None, reached: bool | None) -> None:
    """Just reaching it counts; without a target there is no verdict."""
    assert Figure("share", 1.0, "core", target).reached is reached


def test_latencies_are_told_in_milliseconds_with_the_worst_last() -> None:
    """Each percentile keeps its own target and its own yardstick."""
    median, tail, worst = latencies("reply", [0.001, 0.002, 0.009], {50: 3.0, 99: None}, {50: "20"})
    assert (median.name, median.value, median.target, median.classic) == ("reply p50", 2.0, 3.0, "20")
    assert (tail.value, tail.target, tail.classic) == (9.0, None, "")
    assert (worst.name, worst.value) == ("reply worst of 3", 9.0)
