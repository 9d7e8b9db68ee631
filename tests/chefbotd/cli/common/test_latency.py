"""Latency figures from stamps written by hand."""

import math

import pytest

from chefbotd.cli.drive.course_driver import Latencies, Ping, percentile


def test_percentiles_are_nearest_rank() -> None:
    """Of 1..20 the 50th percentile is the 10th value, the 95th the 19th, the 99th the 20th."""
    values = list(range(20, 0, -1))
    assert [percentile(values, p) for p in (0, 50, 95, 99, 100)] == [1, 10, 19, 20, 20]


def test_no_values_have_no_percentile() -> None:
    """Nothing measured is not a number, rather than a good one."""
    assert math.isnan(percentile([], 50))


def test_a_ping_compares_two_clocks() -> None:
    """Asked at 10, answered at 12, stamped 111: the other clock is 100 ahead."""
    ping = Ping(sent_s=10.0, received_s=12.0, stamp_s=111.0)
    assert (ping.round_trip_s, ping.clock_offset_s) == (2.0, 100.0)


def test_ages_use_the_quickest_ping() -> None:
    """An event stamped 119.5 there that arrives at 20 here is 0.5 old when that clock is 100 ahead."""
    seen = Latencies([Ping(10.0, 12.0, 115.0), Ping(14.0, 14.1, 114.05)], [(20.0, 119.5)])
    assert seen.ages_s() == pytest.approx([0.5])
    assert seen.round_trips_s() == pytest.approx([2.0, 0.1])


def test_without_a_ping_ages_are_unknown() -> None:
    """Two clocks that were never compared tell no age."""
    assert Latencies([], [(20.0, 19.5)]).ages_s() == []
