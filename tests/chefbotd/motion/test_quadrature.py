"""Quadrature: every transition, and speed from edge timing."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.motion.quadrature import (
    START,
    Edge,
    QuadratureParameters,
    QuadratureState,
    decode,
    rate_counts_s,
    rebase,
)

PARAMETERS = QuadratureParameters(window_s=0.04, standstill_s=0.5)
FORWARD = (0b00, 0b10, 0b11, 0b01)


def turned(
    counts: int, period_s: float, state: QuadratureState = START, from_s: float = 1.0
) -> QuadratureState:
    """The state after so many evenly spaced edges, the sign being the direction; starts from level 00."""
    first = START if state is not START else decode(PARAMETERS, START, [Edge(from_s - 1.0, 0)])
    state = first if state is START else state
    sign = 1 if counts > 0 else -1
    now = FORWARD.index(state.levels or 0)
    edges = [Edge(from_s + k * period_s, FORWARD[(now + sign * (k + 1)) % 4]) for k in range(abs(counts))]
    return decode(PARAMETERS, state, edges)


@pytest.mark.parametrize("old", range(4))
@pytest.mark.parametrize("new", range(4))
def test_every_transition_counts_as_the_gray_code_says(old: int, new: int) -> None:
    """One place along 00, 10, 11, 01 is +1, one back -1, none 0; two at once is illegal and counts nothing."""
    along = (FORWARD.index(new) - FORWARD.index(old)) % 4
    state = decode(PARAMETERS, START, [Edge(0.0, old), Edge(0.1, new)])
    assert state.levels == new
    assert (state.counts, state.illegal) == {0: (0, 0), 1: (1, 0), 2: (0, 1), 3: (-1, 0)}[along]


@settings(max_examples=100)
@given(st.lists(st.integers(0, 3), max_size=60), st.integers(0, 60))
def test_how_edges_are_cut_into_bursts_makes_no_difference(levels: list[int], cut: int) -> None:
    """Two bursts leave the same counts, illegal transitions, run and speed as one."""
    edges = [Edge(0.01 * k, level) for k, level in enumerate(levels)]
    whole = decode(PARAMETERS, START, edges)
    halves = decode(PARAMETERS, decode(PARAMETERS, START, edges[:cut]), edges[cut:])
    assert halves == whole


@settings(max_examples=50)
@given(st.lists(st.sampled_from([1, -1]), max_size=200))
def test_counts_are_the_way_that_the_wheel_went(steps: list[int]) -> None:
    """Forward and back in any order: the sum of the steps, without an illegal one."""
    phase, edges = 0, [Edge(0.0, FORWARD[0])]
    for k, step in enumerate(steps):
        phase += step
        edges.append(Edge(0.001 * (k + 1), FORWARD[phase % 4]))
    state = decode(PARAMETERS, START, edges)
    assert (state.counts, state.illegal) == (sum(steps), 0)


@pytest.mark.parametrize("period_s", [0.0005, 0.004, 0.05, 0.3])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_steady_wheel_has_its_speed_at_any_rate(period_s: float, sign: int) -> None:
    """2000 counts/s, 250, 20 or 3.3: one count per period, in either direction, from the sixth edge on."""
    state = turned(sign * 100, period_s)
    assert rate_counts_s(PARAMETERS, state, 1.0 + 99 * period_s) == pytest.approx(sign / period_s)
    assert state.direction == sign


def test_unequal_phases_do_not_ripple() -> None:
    """Widths of 3, 7, 4 and 6 ms repeat every 20 ms: 200 counts/s after every edge, not 143 to 333."""
    widths_s, at_s, state = (0.003, 0.007, 0.004, 0.006), 0.0, START
    rates = []
    for k in range(40):
        at_s += widths_s[k % 4]
        state = decode(PARAMETERS, state, [Edge(at_s, FORWARD[k % 4])])
        rates.append(rate_counts_s(PARAMETERS, state, at_s))
    assert rates[5:] == pytest.approx([200.0] * 35)


def test_speed_decays_while_no_edge_comes() -> None:
    """At 100 counts/s an edge is due after 10 ms; 50 ms without one means at most 20 counts/s, 0.6 s means none."""
    state = turned(20, 0.01)
    last_s = 1.0 + 19 * 0.01
    rates = [rate_counts_s(PARAMETERS, state, last_s + quiet_s) for quiet_s in (0.0, 0.01, 0.05, 0.5, 0.6)]
    assert rates == pytest.approx([100.0, 100.0, 20.0, 2.0, 0.0])


def test_a_reversal_is_not_timed_against_the_way_there() -> None:
    """The first edge back says only that it turned; the second, 20 ms later, says 50 counts/s backwards."""
    state = turned(10, 0.01)
    back = turned(-1, 0.02, state, from_s=1.11)
    assert (back.counts, rate_counts_s(PARAMETERS, back, 1.11)) == (9, 0.0)
    back = turned(-1, 0.02, back, from_s=1.13)
    assert (back.counts, rate_counts_s(PARAMETERS, back, 1.13)) == (8, pytest.approx(-50.0))


def test_a_wheel_that_trembles_on_an_edge_stands() -> None:
    """To and fro over one edge a thousand times a second is no speed."""
    edges = [Edge(0.001 * k, FORWARD[k % 2]) for k in range(101)]
    state = decode(PARAMETERS, START, edges)
    assert (state.counts, rate_counts_s(PARAMETERS, state, 0.1)) == (0, 0.0)


def test_the_first_edge_after_a_rest_has_no_speed_and_the_second_has() -> None:
    """Ten seconds of standing are not averaged into the start."""
    state = turned(1, 0.1, turned(10, 0.01), from_s=11.0)
    assert rate_counts_s(PARAMETERS, state, 11.0) == 0.0
    state = turned(1, 0.1, state, from_s=11.1)
    assert rate_counts_s(PARAMETERS, state, 11.1) == pytest.approx(10.0)


def test_a_time_that_goes_back_starts_the_timing_anew() -> None:
    """A damaged time still counts its edge; no speed is made of it."""
    state = turned(1, 0.01, turned(10, 0.01), from_s=0.5)
    assert (state.counts, rate_counts_s(PARAMETERS, state, 0.5)) == (11, 0.0)


def test_an_illegal_transition_breaks_the_timing_and_not_the_count() -> None:
    """Two levels at once: one more illegal, the position stays, and speed waits for two good edges."""
    state = turned(8, 0.01)
    assert state.levels == 0b00
    state = decode(PARAMETERS, state, [Edge(1.08, 0b11)])
    assert (state.counts, state.illegal, rate_counts_s(PARAMETERS, state, 1.08)) == (8, 1, 0.0)
    state = turned(2, 0.01, state, from_s=1.09)
    assert (state.counts, rate_counts_s(PARAMETERS, state, 1.1)) == (10, pytest.approx(100.0))


def test_a_repeated_level_is_nothing() -> None:
    """A pair of edges lost together leaves the same levels: no count, no error, no break."""
    state = turned(8, 0.01)
    assert decode(PARAMETERS, state, [Edge(1.08, 0b00)]) == state


def test_a_rebased_wheel_goes_on_from_its_count() -> None:
    """After a restart of the board the next edge is a reference, whatever its levels."""
    state = decode(PARAMETERS, rebase(turned(8, 0.01)), [Edge(0.1, 0b11), Edge(0.2, 0b01)])
    assert (state.counts, state.illegal) == (9, 0)


def test_a_wheel_that_never_turned_stands() -> None:
    """Without an edge, and with the reference alone, there is no speed."""
    assert rate_counts_s(PARAMETERS, START, 1.0) == 0.0
    assert rate_counts_s(PARAMETERS, decode(PARAMETERS, START, [Edge(0.0, 2)]), 1.0) == 0.0


def test_what_is_remembered_is_bounded() -> None:
    """A window of 0.04 s at 10,000 counts/s is 400 edges; a million would not be more."""
    assert len(turned(5000, 0.0001).times_s) <= 402


def test_a_smooth_start_is_a_smooth_speed() -> None:
    """At 4 rad/s2 of a wheel with 80 counts a turn the estimate follows within a cycle's delay and never jumps back."""
    per_rad = 80 / math.tau
    times_s = [math.sqrt(2 * k / per_rad / 4.0) for k in range(1, 200)]
    state, rates = START, []
    for k, at_s in enumerate(times_s):
        state = decode(PARAMETERS, state, [Edge(at_s, FORWARD[k % 4])])
        rates.append(rate_counts_s(PARAMETERS, state, at_s))
    assert all(after >= before - 1e-9 for before, after in pairwise(rates))
    assert rates[-1] == pytest.approx(4.0 * times_s[-1] * per_rad, rel=0.03)
