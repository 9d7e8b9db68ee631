"""The square benchmark is pure, so its figures can be promised."""

from benchmarks import square


def test_exact_arcs_stray_by_no_more_than_the_ticks_are_coarse() -> None:
    """A tick is 0.067 mm; the classic rule is off by a hundred times as much."""
    exact, midpoint, classic = (figure.value for figure in square.run().figures)
    assert exact < 0.067 <= midpoint
    assert classic > 6.7
