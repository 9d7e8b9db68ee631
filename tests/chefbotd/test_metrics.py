"""The registry of figures: what is added is collected, as it is at that moment."""

from collections import Counter

import pytest

from chefbotd.metrics import Histogram, Kind, Metrics


def test_figures_are_read_when_they_are_collected_and_not_before() -> None:
    """A counter at 3 when it was added, and at 5 when it is asked for."""
    steps, metrics = [3], Metrics()
    metrics.counter("control_steps", "Control steps.", lambda: steps[0])
    steps[0] = 5
    assert metrics.collect() == {"control_steps": 5}


def test_figures_come_in_the_order_in_which_they_were_added() -> None:
    """With all that a schema or a page needs to know of each."""
    metrics = Metrics()
    metrics.optional_gauge("skew_ppm", "The board clock's skew.", lambda: None)
    metrics.gauge("loop_lag_s", "The worst lag.", lambda: 0.25)
    metrics.counters("refused", "Lines refused.", "reason", lambda: {"overlong": 2})
    assert [(m.name, m.kind, m.annotation, m.label) for m in metrics] == [
        ("skew_ppm", Kind.GAUGE, float | None, None),
        ("loop_lag_s", Kind.GAUGE, float, None),
        ("refused", Kind.COUNTER, dict[str, int], "reason"),
    ]
    assert list(metrics.collect().items()) == [
        ("skew_ppm", None),
        ("loop_lag_s", 0.25),
        ("refused", {"overlong": 2}),
    ]


def test_what_was_collected_does_not_change_any_more() -> None:
    """A part goes on counting in its own mapping."""
    refused, metrics = Counter(overlong=1), Metrics()
    metrics.counters("refused", "Lines refused.", "reason", lambda: refused)
    collected = metrics.collect()
    refused["overlong"] += 1
    assert collected == {"refused": {"overlong": 1}}


@pytest.mark.parametrize("name", ["Steps", "steps-total", "", "1st", "control steps"])
def test_a_name_that_no_metrics_page_could_show_is_refused(name: str) -> None:
    """The message has the name in it."""
    with pytest.raises(ValueError, match=f"snake case, got '{name}'"):
        Metrics().counter(name, "Something.", lambda: 0)


def test_two_parts_cannot_share_a_name() -> None:
    """The second is refused, and the first stays."""
    metrics = Metrics()
    metrics.counter("steps", "Steps.", lambda: 1)
    with pytest.raises(ValueError, match="there is a metric named 'steps' already"):
        metrics.gauge("steps", "Other steps.", lambda: 2.0)
    assert metrics.collect() == {"steps": 1}


def test_a_histogram_counts_each_value_at_the_lowest_bound_that_holds_it() -> None:
    """A value that equals a bound belongs to it, and one above the last bound is counted too."""
    lag, metrics = Histogram((0.001, 0.02)), Metrics()
    metrics.histogram("lag_s", "How late.", lag)
    for value in (0.0005, 0.001, 0.0011, 0.02, 3.0):
        lag.observe(value)
    assert metrics.collect() == {"lag_s": {"0.001": 2, "0.02": 2, "inf": 1}}
    assert lag.total == pytest.approx(3.0226)


@pytest.mark.parametrize("bounds", [(), (0.1, 0.1), (0.2, 0.1)])
def test_a_histogram_without_rising_bounds_is_refused(bounds: tuple[float, ...]) -> None:
    """The message has them in it."""
    with pytest.raises(ValueError, match="the bounds of a histogram rise"):
        Histogram(bounds)
