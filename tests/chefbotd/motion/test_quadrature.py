"""Quadrature: every transition, and what is made of those that cannot be."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.core.events import EdgeBurst
from chefbotd.motion.edge_speed import QuadratureParameters
from chefbotd.motion.quadrature import START, QuadratureState, decode, rate_counts_s, rebase
from tests.budget import examples

PARAMETERS = QuadratureParameters(window_s=0.04, standstill_s=5.0)
FORWARD = (0b00, 0b10, 0b11, 0b01)


def told(state: QuadratureState, *edges: tuple[float, int], lost: int = 0) -> QuadratureState:
    """The state after a burst of edges (time, levels), before which the board lost so many."""
    times_s, levels = zip(*edges, strict=True)
    total = ((state.total or 0) + lost + len(edges)) % 2**16
    return decode(PARAMETERS, state, EdgeBurst(0, total, levels, times_s))


def turned(
    counts: int, period_s: float, state: QuadratureState = START, from_s: float = 1.0, lost: int = 0
) -> QuadratureState:
    """The state after so many evenly spaced edges, the sign being the direction; a fresh one starts from level 00."""
    if state is START:
        state = told(START, (from_s - 1.0, 0))
    sign = 1 if counts > 0 else -1
    now = FORWARD.index(state.levels or 0)
    edges = [(from_s + k * period_s, FORWARD[(now + sign * (k + 1)) % 4]) for k in range(abs(counts))]
    return told(state, *edges, lost=lost)


@pytest.mark.parametrize("old", range(4))
@pytest.mark.parametrize("new", range(4))
def test_every_transition_counts_as_the_gray_code_says(old: int, new: int) -> None:
    """One place along 00, 10, 11, 01 is +1, one back -1; none is a repetition and two are illegal, and count nothing."""
    along = (FORWARD.index(new) - FORWARD.index(old)) % 4
    state = told(START, (0.0, old), (0.1, new))
    assert state.levels == new
    seen = (state.counts, state.repeated, state.illegal)
    assert seen == {0: (0, 1, 0), 1: (1, 0, 0), 2: (0, 0, 1), 3: (-1, 0, 0)}[along]


@settings(max_examples=examples(100))
@given(st.lists(st.integers(0, 3), min_size=2, max_size=60), st.integers(1, 59))
def test_how_edges_are_cut_into_bursts_makes_no_difference(levels: list[int], cut: int) -> None:
    """Two bursts leave the same counts, oddities, run and speed as one."""
    edges = [(0.01 * k, level) for k, level in enumerate(levels)]
    cut = min(cut, len(edges) - 1)
    assert told(told(START, *edges[:cut]), *edges[cut:]) == told(START, *edges)


@settings(max_examples=examples(50))
@given(st.lists(st.sampled_from([1, -1]), max_size=200))
def test_counts_are_the_way_that_the_wheel_went(steps: list[int]) -> None:
    """Forward and back in any order: the sum of the steps, without an odd one."""
    phase, edges = 0, [(0.0, FORWARD[0])]
    for k, step in enumerate(steps):
        phase += step
        edges.append((0.001 * (k + 1), FORWARD[phase % 4]))
    state = told(START, *edges)
    assert (state.counts, state.illegal, state.repeated, state.lost) == (sum(steps), 0, 0, 0)


def test_only_the_last_edges_of_a_burst_need_times() -> None:
    """Ten edges 10 ms apart of which the last two are timed: ten counts, 100 counts/s."""
    state = told(START, (0.0, 0))
    levels = tuple(FORWARD[k % 4] for k in range(1, 11))
    state = decode(PARAMETERS, state, EdgeBurst(0, 11, levels, (0.99, 1.0)))
    assert (state.counts, rate_counts_s(PARAMETERS, state, 1.0)) == (10, pytest.approx(100.0))


def test_a_wheel_that_trembles_on_an_edge_stands() -> None:
    """To and fro over one edge a thousand times a second is no speed."""
    state = told(START, *[(0.001 * k, FORWARD[k % 2]) for k in range(101)])
    assert (state.counts, rate_counts_s(PARAMETERS, state, 0.1)) == (0, 0.0)


def test_an_illegal_transition_moves_nothing_and_does_not_say_that_the_wheel_stands() -> None:
    """Two levels at once at 100 counts/s: counted, the position stays, and the speed holds until two edges give one."""
    state = turned(8, 0.01)
    state = told(state, (1.08, 0b11))
    assert (state.counts, state.illegal) == (8, 1)
    assert rate_counts_s(PARAMETERS, state, 1.08) == pytest.approx(100.0)
    assert rate_counts_s(PARAMETERS, state, 1.12) == pytest.approx(20.0)  # 0.05 s after the last good edge
    state = turned(2, 0.02, state, from_s=1.10)
    assert (state.counts, rate_counts_s(PARAMETERS, state, 1.12)) == (10, pytest.approx(50.0))


def test_what_was_known_before_a_loss_is_not_held_against_a_wheel_that_turned_round() -> None:
    """One edge back after an illegal one: it goes the other way, and nobody knows how fast."""
    state = turned(-1, 0.01, told(turned(8, 0.01), (1.08, 0b11)), from_s=1.10)
    assert (state.counts, rate_counts_s(PARAMETERS, state, 1.10)) == (7, 0.0)


def test_a_loss_while_another_is_not_over_holds_what_was_known_before_both() -> None:
    """Illegal, one good edge, illegal again: still 100 counts/s, by the last good edge's time."""
    state = told(turned(8, 0.01), (1.08, 0b11))
    state = told(turned(1, 0.01, state, from_s=1.09), (1.10, 0b10))
    assert state.illegal == 2
    assert rate_counts_s(PARAMETERS, state, 1.10) == pytest.approx(100.0)


def test_repeated_levels_are_counted_and_change_nothing_else() -> None:
    """A bounce (the levels were back before they were read): neither a count nor a break in the timing."""
    state = turned(8, 0.01)
    bounced = told(state, (1.075, 0b00))
    assert (bounced.counts, bounced.repeated, bounced.illegal, bounced.run) == (8, 1, 0, state.run)
    after = turned(4, 0.01, bounced, from_s=1.08)
    assert (after.counts, after.repeated, after.lost) == (12, 1, 0)
    assert rate_counts_s(PARAMETERS, after, 1.11) == pytest.approx(100.0)


@pytest.mark.parametrize("lost", [1, 2, 3, 4, 400])
def test_edges_that_never_came_are_no_motion(lost: int) -> None:
    """However many (four leave the levels alike): counted as lost, the next edge is a reference, and the speed holds."""
    state = turned(1, 0.01, turned(8, 0.01), from_s=1.30, lost=lost)
    assert (state.counts, state.lost, state.illegal) == (8, lost, 0)
    assert rate_counts_s(PARAMETERS, state, 1.08) == pytest.approx(100.0)
    state = turned(2, 0.02, state, from_s=1.32)
    assert (state.counts, rate_counts_s(PARAMETERS, state, 1.34)) == (10, pytest.approx(50.0))


def test_the_boards_total_wraps() -> None:
    """65,535 edges and then three: none is missing."""
    state = decode(PARAMETERS, START, EdgeBurst(0, 65_535, (0,), (1.0,)))
    state = decode(PARAMETERS, state, EdgeBurst(0, 2, (2, 3, 1), (1.1, 1.2, 1.3)))
    assert (state.counts, state.lost) == (3, 0)


def test_a_rebased_wheel_goes_on_from_its_count() -> None:
    """After a restart of the board the next edge is a reference, whatever its levels, and its total begins anew."""
    state = decode(PARAMETERS, rebase(turned(8, 0.01)), EdgeBurst(0, 2, (0b11, 0b01), (0.1, 0.2)))
    assert (state.counts, state.illegal, state.lost) == (9, 0, 0)


def test_a_wheel_that_never_turned_stands() -> None:
    """Without an edge, and with the reference alone, there is no speed."""
    assert rate_counts_s(PARAMETERS, START, 1.0) == 0.0
    assert rate_counts_s(PARAMETERS, told(START, (0.0, 2)), 1.0) == 0.0
