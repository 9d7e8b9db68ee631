"""Computes how fast a wheel turns from the times of its encoder's edges.

The M/T method (Ohmae et al., "A microprocessor-controlled high-accuracy wide-range speed regulator for motor drives",
IEEE Trans. Ind. Electron. IE-29, 1982): whole counts divided by the time between the edges that bound them. At low
speed that is one period, at high speed an average over a window. The four phases of a cycle differ in width, because
discs and detectors are not exact. Only two edges of the same kind are whole cycles apart (Wu et al., "FPGA-based
velocity estimation for control of robots with low-resolution encoders", IROS 2018). So the bounds are edges of one
kind wherever two are known.
"""

import math
from bisect import bisect_left
from collections.abc import Sequence
from itertools import pairwise

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record, replace

CYCLE = 4
"""Counts in a full cycle of both lines: every phase once."""

STEADY, STEADY_AT_FIRST = (0.4, 2.5), (0.25, 4.0)
"""A gap outside these shares of the mean before it is no unequal phase (0.5 to 1.5 at the worst), but another speed.

Before a whole cycle is known, the mean may itself be that of the widest or narrowest phase.
"""


class QuadratureParameters(Parameters):
    """Speed is averaged over ``window_s``, or over one cycle if the edges are slower than that.

    It is zero ``standstill_s`` after the last edge: a wheel whose edges come more rarely counts as standing.
    """

    window_s: float = Field(default=0.04, gt=0, le=1)
    standstill_s: float = Field(default=5.0, gt=0, le=60)


class TimedEdge(Record, frozen=True, array_like=True):
    """An edge whose time is known: its count, and its time by the board's clock."""

    counts: int
    at_s: float


class HeldRate(Record, frozen=True, array_like=True):
    """A speed, and the time of the last edge that it is computed from."""

    rate_counts_s: float
    since_s: float


class EdgeRun(Record, frozen=True):
    """The edges over which speed is measured, newest last, all in one ``direction`` and without a rest or a loss.

    ``direction`` is +1, -1, or 0 before the first count. After a loss ``held`` is the speed before it, which is used
    until two edges are known again.
    """

    direction: int = 0
    marks: tuple[TimedEdge, ...] = ()
    held: HeldRate | None = None


START = EdgeRun()
STANDING = HeldRate(0.0, -math.inf)


def reverse_run(run: EdgeRun, direction: int) -> EdgeRun:
    """The wheel has changed direction: edges from before are not timed against the new ones."""
    goes_on = run.held is not None and run.held.rate_counts_s * direction > 0
    return EdgeRun(direction, (), run.held if goes_on else None)


def break_run(params: QuadratureParameters, run: EdgeRun) -> EdgeRun:
    """Edges were lost, nobody knows how many: timing starts anew. Until then the wheel is not said to stand."""
    if not run.marks:
        return EdgeRun(held=run.held)
    last_s = run.marks[-1].at_s
    return EdgeRun(held=HeldRate(rate_counts_s(params, run, last_s), last_s))


def extend(params: QuadratureParameters, run: EdgeRun, mark: TimedEdge) -> EdgeRun:
    """The run with a new edge, without the edges that it cannot be timed against.

    These are all of them after a rest, or if the edge does not follow the one before; all but the last if the speed
    has jumped.
    """
    if not run.marks:
        return replace(run, marks=(mark,))
    if not 0.0 < mark.at_s - run.marks[-1].at_s <= params.standstill_s:
        return EdgeRun(run.direction, (mark,))
    steady = _goes_on(params, run.marks, mark)
    kept = _recent(params, run.marks, mark.at_s) if steady else run.marks[-1:]
    return EdgeRun(run.direction, (*kept, mark))


def _goes_on(params: QuadratureParameters, marks: Sequence[TimedEdge], new: TimedEdge) -> bool:
    """Whether the new edge fits the speed before it."""
    if len(marks) < 2:
        return True
    newest, far = marks[-1], _far_end(params, marks)
    least, most = STEADY_AT_FIRST if (newest.counts - far.counts) % CYCLE else STEADY
    return least <= _gap_s(newest, new) / _gap_s(far, newest) <= most


def _gap_s(before: TimedEdge, after: TimedEdge) -> float:
    """The mean time of a count between two edges."""
    return (after.at_s - before.at_s) / abs(after.counts - before.counts)


def _last_cycle(marks: Sequence[TimedEdge]) -> list[TimedEdge]:
    """The edges within one cycle of the newest; the newest two if there are fewer."""
    newest = marks[-1].counts
    near = [mark for mark in marks if abs(newest - mark.counts) <= CYCLE]
    return near if len(near) > 1 else list(marks[-2:])


def _recent(
    params: QuadratureParameters, marks: tuple[TimedEdge, ...], now_s: float
) -> tuple[TimedEdge, ...]:
    """The part of a run that a speed can need: the window, and a cycle before it."""
    first = bisect_left(marks, now_s - params.window_s, key=lambda mark: mark.at_s)
    return marks[max(0, first - CYCLE) :]


def rate_counts_s(params: QuadratureParameters, run: EdgeRun, board_s: float) -> float:
    """Counts per second at ``board_s``, forward positive.

    Once the next edge is overdue, the rate is the highest at which it would not have come yet: it decays with time.
    """
    measured = _held_rate(params, run)
    quiet_s = board_s - measured.since_s
    if quiet_s > params.standstill_s:
        return 0.0
    if quiet_s <= 0 or not measured.rate_counts_s:
        return measured.rate_counts_s
    most = _widest_phase(run.marks, abs(measured.rate_counts_s)) / quiet_s
    return max(-most, min(most, measured.rate_counts_s))


def _held_rate(params: QuadratureParameters, run: EdgeRun) -> HeldRate:
    marks = run.marks
    if len(marks) > 1:
        return HeldRate(run.direction / _gap_s(_far_end(params, marks), marks[-1]), marks[-1].at_s)
    if run.held is None:
        return STANDING
    return replace(run.held, since_s=marks[-1].at_s) if marks else run.held


def _far_end(params: QuadratureParameters, marks: Sequence[TimedEdge]) -> TimedEdge:
    """The edge to measure from: the oldest in the window of the same kind as the newest, else the latest of that kind.

    Where there is none, as in the first cycle of a run: the first that is near.
    """
    newest = marks[-1]
    like = [mark for mark in marks[:-1] if (newest.counts - mark.counts) % CYCLE == 0]
    if not like:
        return _last_cycle(marks)[0]
    return next((mark for mark in like if mark.at_s >= newest.at_s - params.window_s), like[-1])


def _widest_phase(marks: Sequence[TimedEdge], rate_counts_s: float) -> float:
    """The width of the widest phase of the last cycle in counts, 1 or more: the next edge may take that long.

    Where the times of three phases are known, the fourth is the rest of the cycle.
    """
    if len(marks) < 2:
        return 1.0
    cycle = _last_cycle(marks)
    gaps_s, mean_s = [_gap_s(*pair) for pair in pairwise(cycle)], _gap_s(cycle[0], cycle[-1])
    if len(gaps_s) == CYCLE - 1:
        mean_s = 1 / rate_counts_s
        gaps_s.append(CYCLE * mean_s - sum(gaps_s))
    return max(1.0, max(gaps_s) / mean_s)
