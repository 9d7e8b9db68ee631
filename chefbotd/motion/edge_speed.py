"""How fast a wheel turns, from the times of its encoder's edges.

The M/T method (Ohmae et al., "A microprocessor-controlled high-accuracy wide-range speed regulator for motor drives",
IEEE Trans. Ind. Electron. IE-29, 1982): whole counts over the time between the very edges that bound them, a period at
low speed and an average over a window at high speed. The four phases of a cycle are unequally wide, as discs and
detectors are made; only an edge and its like in another cycle are whole cycles apart (Wu et al., "FPGA-based velocity
estimation for control of robots with low-resolution encoders", IROS 2018). So the bounds are edges of one kind wherever
two are known.
"""

import math
from bisect import bisect_left
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

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
    """Speed is averaged over ``window_s``, or over one cycle of slower edges.

    It is zero ``standstill_s`` after the last edge: a wheel whose edges come more rarely than that stands.
    """

    window_s: float = Field(default=0.04, gt=0, le=1)
    standstill_s: float = Field(default=5.0, gt=0, le=60)


class Mark(NamedTuple):
    """An edge whose time is known: the count that it made, and when it was by the board's clock."""

    counts: int
    at_s: float


class Known(NamedTuple):
    """A speed, and when the last edge was that it is known from."""

    rate_counts_s: float
    since_s: float


class Run(Record, frozen=True):
    """What speed is measured over: the latest edges, newest last, in one ``direction`` and without a rest or a loss.

    ``direction`` is +1, -1, or 0 before the first count. After a loss ``held`` is the speed before it, which stands in
    until two edges are known again.
    """

    direction: int = 0
    marks: tuple[Mark, ...] = ()
    held: Known | None = None


START = Run()
STANDING = Known(0.0, -math.inf)


def turned(run: Run, direction: int) -> Run:
    """The wheel counts this way now: what came before the other way is not timed against it."""
    goes_on = run.held is not None and run.held.rate_counts_s * direction > 0
    return Run(direction, (), run.held if goes_on else None)


def broken(params: QuadratureParameters, run: Run) -> Run:
    """Edges were lost, nobody knows how many: timing starts anew, and meanwhile the wheel is not said to stand."""
    if not run.marks:
        return Run(held=run.held)
    last_s = run.marks[-1].at_s
    return Run(held=Known(rate_counts_s(params, run, last_s), last_s))


def extend(params: QuadratureParameters, run: Run, mark: Mark) -> Run:
    """The run with a new edge, and without those that it cannot be timed against.

    These are all when it came after a rest, or not after the one before; when the speed has jumped, all but that one.
    """
    if not run.marks:
        return replace(run, marks=(mark,))
    if not 0.0 < mark.at_s - run.marks[-1].at_s <= params.standstill_s:
        return Run(run.direction, (mark,))
    steady = _goes_on(params, run.marks, mark)
    kept = _recent(params, run.marks, mark.at_s) if steady else run.marks[-1:]
    return Run(run.direction, (*kept, mark))


def _goes_on(params: QuadratureParameters, marks: Sequence[Mark], new: Mark) -> bool:
    """Whether the wheel may still turn as it did before the new edge."""
    if len(marks) < 2:
        return True
    newest, far = marks[-1], _far_end(params, marks)
    least, most = STEADY_AT_FIRST if (newest.counts - far.counts) % CYCLE else STEADY
    return least <= _gap_s(newest, new) / _gap_s(far, newest) <= most


def _gap_s(before: Mark, after: Mark) -> float:
    """The mean time of a count between two edges."""
    return (after.at_s - before.at_s) / abs(after.counts - before.counts)


def _last_cycle(marks: Sequence[Mark]) -> list[Mark]:
    """The edges not more than a cycle before the newest; with fewer times than that, the newest two."""
    newest = marks[-1].counts
    near = [mark for mark in marks if abs(newest - mark.counts) <= CYCLE]
    return near if len(near) > 1 else list(marks[-2:])


def _recent(params: QuadratureParameters, marks: tuple[Mark, ...], now_s: float) -> tuple[Mark, ...]:
    """As much of a run as a speed can need: the window, and a cycle before it."""
    first = bisect_left(marks, now_s - params.window_s, key=lambda mark: mark.at_s)
    return marks[max(0, first - CYCLE) :]


def rate_counts_s(params: QuadratureParameters, run: Run, board_s: float) -> float:
    """Counts per second at ``board_s``, forward positive.

    Once the next edge is overdue the rate is the highest that would not have brought it yet: it decays with the time.
    """
    known = _known(params, run)
    quiet_s = board_s - known.since_s
    if quiet_s > params.standstill_s:
        return 0.0
    if quiet_s <= 0 or not known.rate_counts_s:
        return known.rate_counts_s
    most = _widest_phase(run.marks, abs(known.rate_counts_s)) / quiet_s
    return max(-most, min(most, known.rate_counts_s))


def _known(params: QuadratureParameters, run: Run) -> Known:
    marks = run.marks
    if len(marks) > 1:
        return Known(run.direction / _gap_s(_far_end(params, marks), marks[-1]), marks[-1].at_s)
    if run.held is None:
        return STANDING
    return run.held._replace(since_s=marks[-1].at_s) if marks else run.held


def _far_end(params: QuadratureParameters, marks: Sequence[Mark]) -> Mark:
    """The edge to measure from: the oldest of the window that is like the newest, or else the latest of the like.

    Where there is none, as in the first cycle of a run: the first that is near.
    """
    newest = marks[-1]
    like = [mark for mark in marks[:-1] if (newest.counts - mark.counts) % CYCLE == 0]
    if not like:
        return _last_cycle(marks)[0]
    return next((mark for mark in like if mark.at_s >= newest.at_s - params.window_s), like[-1])


def _widest_phase(marks: Sequence[Mark], rate_counts_s: float) -> float:
    """How many counts the widest phase of the last cycle is worth, 1 or more: so long the next edge may take.

    Where the times of three phases are known, the fourth has what they leave of a cycle.
    """
    if len(marks) < 2:
        return 1.0
    cycle = _last_cycle(marks)
    gaps_s, mean_s = [_gap_s(*pair) for pair in pairwise(cycle)], _gap_s(cycle[0], cycle[-1])
    if len(gaps_s) == CYCLE - 1:
        mean_s = 1 / rate_counts_s
        gaps_s.append(CYCLE * mean_s - sum(gaps_s))
    return max(1.0, max(gaps_s) / mean_s)
