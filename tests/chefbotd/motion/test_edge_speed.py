"""Speed from edge timing: right at any rate, without a ripple, and honest while no edge comes."""

import math
from itertools import accumulate, pairwise

import pytest

from chefbotd.motion.edge_speed import (
    START,
    EdgeRun,
    QuadratureParameters,
    TimedEdge,
    extend,
    rate_counts_s,
    reverse_run,
)

PARAMETERS = QuadratureParameters(window_s=0.04, standstill_s=5.0)

EVEN = (1.0, 1.0, 1.0, 1.0)
UNEVEN = (0.7, 1.3, 0.8, 1.2)
WORST = (0.5, 1.5, 0.5, 1.5)
"""Widths of the phases: a duty of 45 to 55 % and 90 degrees give or take a few, and what data sheets still allow."""

CYCLE_S = 0.02


def times_s(rate_counts_s: float, widths: tuple[float, ...], counts: int, from_s: float = 1.0) -> list[float]:
    """When a wheel's edges come that turns at this rate."""
    return list(accumulate((widths[k % 4] / rate_counts_s for k in range(counts)), initial=from_s))


def run_of(direction: int, edges_s: list[float], run: EdgeRun = START, first: int = 0) -> EdgeRun:
    """A run with an edge at each of these times."""
    run = reverse_run(run, direction) if run.direction != direction else run
    for k, at_s in enumerate(edges_s):
        run = extend(PARAMETERS, run, TimedEdge(first + direction * k, at_s))
    return run


def seen_each_cycle(
    edges_s: list[float], timed: int, until_s: float, late_s: float = 0.0
) -> list[tuple[float, float]]:
    """Time and rate at the end of each board cycle, of whose edges only the last few have times.

    The first cycle ends so late after the first edge.
    """
    run, readings, now_s = reverse_run(START, 1), [], edges_s[0] + late_s
    while now_s < until_s:
        burst = [(k, at_s) for k, at_s in enumerate(edges_s) if now_s - CYCLE_S < at_s <= now_s]
        for k, at_s in burst[-timed:]:
            run = extend(PARAMETERS, run, TimedEdge(k, at_s))
        readings.append((now_s, rate_counts_s(PARAMETERS, run, now_s)))
        now_s += CYCLE_S
    return readings


@pytest.mark.parametrize("rate", [0.5, 1.5, 5.0, 50.0, 160.0, 400.0, 5000.0])
@pytest.mark.parametrize("widths", [EVEN, UNEVEN, WORST])
def test_a_steady_wheel_has_its_speed_after_and_between_all_edges(
    rate: float, widths: tuple[float, ...]
) -> None:
    """Looked at every 20 ms, from the second cycle of edges on (at high rates the fourth of the board): within 0.1 %."""
    edges_s = times_s(rate, widths, max(24, round(rate)))
    settled_s = max(edges_s[5], edges_s[0] + 3 * CYCLE_S)
    rates = [seen for at_s, seen in seen_each_cycle(edges_s, 4, edges_s[-1]) if at_s > settled_s]
    assert len(rates) > 10
    assert rates == pytest.approx([rate] * len(rates), rel=1e-3)


def test_the_phase_that_no_time_tells_has_what_the_others_leave() -> None:
    """400 counts/s are eight edges in each 20 ms; the widest phase always comes after the last, and is waited for."""
    widths = (1.5, 0.8, 0.8, 0.9)
    edges_s = times_s(400.0, widths, 400)
    readings = seen_each_cycle(edges_s, 4, edges_s[-1], late_s=0.95 * 1.5 / 400)
    rates = [rate for at_s, rate in readings if at_s > edges_s[0] + 3 * CYCLE_S]
    assert rates == pytest.approx([400.0] * len(rates), rel=1e-3)


@pytest.mark.parametrize("rate", [1.5, 50.0, 5000.0])
def test_backwards_is_negative(rate: float) -> None:
    """The same wheel the other way."""
    edges_s = times_s(rate, UNEVEN, 20)
    assert rate_counts_s(PARAMETERS, run_of(-1, edges_s), edges_s[-1]) == pytest.approx(-rate)


def test_an_overdue_edge_bounds_the_speed_by_one_count_over_the_time_since_the_last() -> None:
    """At 100 counts/s an edge is due after 10 ms; 50 ms without one are at most 20 counts/s, 4 s at most 0.25."""
    edges_s = times_s(100.0, EVEN, 20)
    run, last_s = run_of(1, edges_s), edges_s[-1]
    rates = [rate_counts_s(PARAMETERS, run, last_s + quiet_s) for quiet_s in (0.0, 0.01, 0.05, 0.5, 4.0)]
    assert rates == pytest.approx([100.0, 100.0, 20.0, 2.0, 0.25])


def test_the_widest_phase_is_waited_for_before_an_edge_is_overdue() -> None:
    """At 1.5 counts/s a phase of 1.3 lasts 0.87 s; twice that without an edge is half the speed, whatever is next."""
    edges_s = times_s(1.5, UNEVEN, 12)
    for newest in range(6, 12):
        run, last_s = run_of(1, edges_s[: newest + 1]), edges_s[newest]
        rates = [rate_counts_s(PARAMETERS, run, last_s + share * 1.3 / 1.5) for share in (0.5, 0.99, 2.0)]
        assert rates == pytest.approx([1.5, 1.5, 0.75])


def test_past_the_standstill_time_the_speed_is_exactly_zero() -> None:
    """5 s after the last edge there is still a bound, a moment later there is none; either way round."""
    for direction in (1, -1):
        run = run_of(direction, times_s(10.0, EVEN, 10))
        last_s = run.marks[-1].at_s
        assert rate_counts_s(PARAMETERS, run, last_s + 4.999) == pytest.approx(direction / 4.999)
        assert rate_counts_s(PARAMETERS, run, last_s + 5.001) == 0.0


def test_after_a_rest_the_first_edge_has_no_speed_and_the_second_has() -> None:
    """Ten seconds of standing are not averaged into the start."""
    run = run_of(1, times_s(100.0, EVEN, 10))
    run = run_of(1, [20.0], run, first=11)
    assert rate_counts_s(PARAMETERS, run, 20.0) == 0.0
    run = run_of(1, [20.1], run, first=12)
    assert rate_counts_s(PARAMETERS, run, 20.1) == pytest.approx(10.0)


def test_a_wheel_that_slows_or_starts_suddenly_is_not_averaged_with_what_it_did() -> None:
    """3 counts/s, then 3 s until an edge: 0.33, no more at the edge than before it; then 80, by its second edge."""
    run = run_of(1, times_s(3.0, EVEN, 4))
    first_s = run.marks[-1].at_s + 3.0
    run = run_of(1, [first_s], run, first=5)
    assert rate_counts_s(PARAMETERS, run, first_s) == pytest.approx(1 / 3)
    run = run_of(1, [first_s + 1 / 80], run, first=6)
    assert rate_counts_s(PARAMETERS, run, first_s + 1 / 80) == pytest.approx(80.0)


def test_a_reversal_is_not_timed_against_the_way_there() -> None:
    """The first edge back says only that it turned; the second, 20 ms later, says 50 counts/s backwards."""
    run = run_of(1, times_s(100.0, UNEVEN, 10))
    back = run_of(-1, [1.2], run, first=9)
    assert rate_counts_s(PARAMETERS, back, 1.2) == 0.0
    back = run_of(-1, [1.22], back, first=8)
    assert rate_counts_s(PARAMETERS, back, 1.22) == pytest.approx(-50.0)


def test_a_time_that_goes_back_starts_the_timing_anew() -> None:
    """A damaged time: no speed is made of it, nor of the times before it."""
    run = run_of(1, [0.5], run_of(1, times_s(100.0, EVEN, 10)), first=11)
    assert rate_counts_s(PARAMETERS, run, 0.5) == 0.0


@pytest.mark.parametrize("timed", [1, 2])
def test_a_board_that_tells_fewer_times_costs_smoothness_and_not_truth(timed: int) -> None:
    """One or two times in 20 ms at 400 counts/s: within what unlike phases can be apart, 0.3 of a count in eight."""
    edges_s = times_s(400.0, UNEVEN, 400)
    rates = [rate for at_s, rate in seen_each_cycle(edges_s, timed, edges_s[-1]) if at_s > edges_s[0] + 0.1]
    assert rates == pytest.approx([400.0] * len(rates), rel=0.3 / 8)


def test_a_smooth_start_is_a_smooth_speed() -> None:
    """At 4 rad/s2 of a wheel with 80 counts a turn the estimate follows within a cycle's delay and never jumps back."""
    per_rad = 80 / math.tau
    edges_s = [math.sqrt(2 * k / per_rad / 4.0) for k in range(1, 200)]
    run, rates = reverse_run(START, 1), []
    for k, at_s in enumerate(edges_s):
        run = extend(PARAMETERS, run, TimedEdge(k, at_s))
        rates.append(rate_counts_s(PARAMETERS, run, at_s))
    assert all(after >= before - 1e-9 for before, after in pairwise(rates))
    assert rates[-1] == pytest.approx(4.0 * edges_s[-1] * per_rad, rel=0.03)


def test_what_is_remembered_is_bounded() -> None:
    """A window of 0.04 s at 10,000 counts/s is 400 edges; a million would not be more."""
    assert len(run_of(1, times_s(10_000.0, EVEN, 2000)).marks) <= 406


def test_edges_of_another_cycle_say_nothing_of_the_widest_phase() -> None:
    """Six counts without times, 20 ms each: 30 ms after the last edge there is at most one count in them.

    The rate is from the edge that is like the newest, 8 counts in 0.15 s; a phase of 30 ms was seen a cycle before.
    """
    marks = tuple(TimedEdge(*mark) for mark in ((0, 0.0), (1, 0.01), (2, 0.04), (3, 0.05), (10, 0.19)))
    run = EdgeRun(1, marks)
    assert rate_counts_s(PARAMETERS, run, 0.19) == pytest.approx(8 / 0.15)
    assert rate_counts_s(PARAMETERS, run, 0.22) == pytest.approx(1 / 0.03)


def test_three_phases_leave_the_fourth_the_rest_of_the_cycle() -> None:
    """10, 15 and 5 ms are 3 counts in 30 ms, which leaves 10 ms: after 30 ms without an edge it is 1.5 / 0.03 s."""
    marks = tuple(TimedEdge(*mark) for mark in ((0, 0.0), (-1, 0.01), (-2, 0.025), (-3, 0.03)))
    run = EdgeRun(-1, marks)
    assert rate_counts_s(PARAMETERS, run, 0.03) == pytest.approx(-100.0)
    assert rate_counts_s(PARAMETERS, run, 0.06) == pytest.approx(-50.0)
