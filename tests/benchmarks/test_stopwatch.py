"""Processor time by part."""

from benchmarks.stopwatch import Stopwatch


def test_time_inside_another_part_is_not_counted_twice() -> None:
    """The outer part does nothing but call the inner one, which works."""
    stopwatch = Stopwatch()
    inner = stopwatch.watch("inner", lambda n: sum(range(n)))
    outer = stopwatch.watch("outer", lambda n: inner(n))
    assert outer(1_000_000) == 499_999_500_000
    assert stopwatch.seconds["inner"] > 10 * stopwatch.seconds["outer"]
