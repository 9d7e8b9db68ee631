"""Quadrature edges to counts and speed, for boards that decode nothing themselves.

Full (4x) decoding by a state table: every edge of A and of B is a count, and a change of both at once is an edge that
was missed. Speed is by the M/T method (Ohmae et al., "A microprocessor-controlled high-accuracy wide-range speed
regulator for motor drives", IEEE Trans. Ind. Electron. IE-29, 1982): whole counts over the time between the very edges
that bound them, so that it is a period at low speed and an average over a window at high speed. Counts become angles
where those of any board do, in ``motion.encoder``.
"""

from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from pydantic import Field

from chefbotd.core.parameters import Parameters

STEPS: tuple[tuple[int | None, ...], ...] = (
    # to 00, 01, 10, 11
    (0, -1, +1, None),  # from 00
    (+1, 0, None, -1),  # from 01
    (-1, None, 0, +1),  # from 10
    (None, +1, -1, 0),  # from 11
)
"""What a change of the levels (A is worth 2, B is worth 1) counts; forward is A before B. None cannot be one edge."""

CYCLE = 4
"""Counts in a full cycle of both lines: over whole cycles the unequal widths of the phases cancel."""


class QuadratureParameters(Parameters):
    """Speed is averaged over ``window_s`` where that is a cycle; after ``standstill_s`` without an edge it is zero."""

    window_s: float = Field(default=0.04, gt=0, le=1)
    standstill_s: float = Field(default=0.5, gt=0, le=10)


class Edge(NamedTuple):
    """The levels after a change of one of them, and when it was by the board's clock."""

    board_s: float
    levels: int


@dataclass(frozen=True, slots=True)
class QuadratureState:
    """One wheel's encoder.

    ``levels`` are None until the first edge, which is the reference and counts nothing. ``times_s`` are the latest edges
    of the present run, newest last: one ``direction`` (+1, -1, or 0 before the first count) without a rest or a gap.
    ``illegal`` counts the transitions that no wheel can make.
    """

    levels: int | None = None
    counts: int = 0
    direction: int = 0
    times_s: tuple[float, ...] = ()
    illegal: int = 0


START = QuadratureState()


def rebase(state: QuadratureState) -> QuadratureState:
    """The board restarted: its next edge is a reference again; what was counted stays."""
    return replace(state, levels=None, direction=0, times_s=())


def decode(params: QuadratureParameters, state: QuadratureState, edges: Iterable[Edge]) -> QuadratureState:
    """The state after these edges, in the order in which they came; levels are 0 to 3."""
    levels, counts, direction, illegal = state.levels, state.counts, state.direction, state.illegal
    run = list(state.times_s)
    for at_s, new in edges:
        step = 0 if levels is None else STEPS[levels][new]
        levels = new
        if step is None:
            illegal += 1
            direction, run = 0, []
        elif step:
            counts += step
            if step != direction or _breaks(params, run, at_s):
                direction, run = step, []
            run.append(at_s)
    return QuadratureState(levels, counts, direction, _recent(params, run), illegal)


def _breaks(params: QuadratureParameters, run: Sequence[float], at_s: float) -> bool:
    """Whether an edge cannot be timed against the one before: it came after a rest, or not after it at all."""
    return bool(run) and not 0.0 < at_s - run[-1] <= params.standstill_s


def _recent(params: QuadratureParameters, run: Sequence[float]) -> tuple[float, ...]:
    """As much of a run as a speed can need: the window with the edge before it, or a cycle."""
    if not run:
        return ()
    first = bisect_left(run, run[-1] - params.window_s)
    return tuple(run[max(0, min(first, len(run) - 1 - CYCLE)) :])


def rate_counts_s(params: QuadratureParameters, state: QuadratureState, board_s: float) -> float:
    """Counts per second at ``board_s``, forward positive.

    While no edge comes the rate decays: a wheel that turned faster than one count in that time would have shown it.
    """
    times_s = state.times_s
    back = _edges_back(params, times_s)
    if not back:
        return 0.0
    rate = back / (times_s[-1] - times_s[-1 - back])
    quiet_s = board_s - times_s[-1]
    if quiet_s > params.standstill_s:
        return 0.0
    return state.direction * (min(rate, 1.0 / quiet_s) if quiet_s > 0 else rate)


def _edges_back(params: QuadratureParameters, times_s: Sequence[float]) -> int:
    """Over how many counts to measure: whole cycles within the window, or up to one cycle of slower ones."""
    if not times_s:
        return 0
    before = len(times_s) - 1
    in_window = before - bisect_left(times_s, times_s[-1] - params.window_s)
    return in_window - in_window % CYCLE or min(CYCLE, before)
