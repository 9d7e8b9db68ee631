"""Converts quadrature edges to counts, for boards that decode nothing themselves.

Full (4x) decoding by a state table: every edge of A and of B is a count. Three impossible things are counted and move
nothing: a change of both levels at once, levels that did not change, and edges that the board counted but did not
send. ``motion.encoder`` turns the counts into angles as for any board; ``motion.edge_speed`` measures the speed.
"""

from chefbotd.core.events import EdgeBurst
from chefbotd.core.record import Record, replace
from chefbotd.motion import edge_speed
from chefbotd.motion.edge_speed import EdgeRun, QuadratureParameters, TimedEdge

STEPS: tuple[tuple[int | None, ...], ...] = (
    # to 00, 01, 10, 11
    (0, -1, +1, None),  # from 00
    (+1, 0, None, -1),  # from 01
    (-1, None, 0, +1),  # from 10
    (None, +1, -1, 0),  # from 11
)
"""What a change of the levels (A is worth 2, B is worth 1) counts; forward is A before B. None cannot be one edge."""

TOTAL_SPAN = 1 << 16


class QuadratureState(Record, frozen=True):
    """One wheel's encoder.

    ``levels`` are None until the next edge, which is the reference and counts nothing; ``total`` is the board's, None
    before it is known. ``illegal`` counts changes of both levels at once: an edge is missing, which way nobody knows.
    ``repeated`` counts edges after which the levels are as before: a line that bounced, or a whole cycle missing.
    ``lost`` counts edges that the board saw and that never came.
    """

    levels: int | None = None
    total: int | None = None
    counts: int = 0
    run: EdgeRun = edge_speed.START
    illegal: int = 0
    repeated: int = 0
    lost: int = 0


START = QuadratureState()


def rebase(state: QuadratureState) -> QuadratureState:
    """The board restarted: its next edge is a reference again; what was counted stays."""
    return replace(state, levels=None, total=None, run=edge_speed.START)


def decode(params: QuadratureParameters, state: QuadratureState, burst: EdgeBurst) -> QuadratureState:
    """The state after the wheel's next burst; levels are 0 to 3.

    Where edges were lost before it, its first one is a reference. A bounce leaves counts and timing as they are.
    """
    state = _account(params, state, burst)
    levels, counts, run, illegal, repeated = state.levels, state.counts, state.run, 0, 0
    untimed = len(burst.levels) - len(burst.times_s)
    for k, new in enumerate(burst.levels):
        step = 0 if levels is None else STEPS[levels][new]
        if step is None:
            illegal += 1
            run = edge_speed.break_run(params, run)
        elif step:
            counts += step
            if step != run.direction:
                run = edge_speed.reverse_run(run, step)
            if k >= untimed:
                run = edge_speed.extend(params, run, TimedEdge(counts, burst.times_s[k - untimed]))
        elif levels is not None:
            repeated += 1
        levels = new
    return replace(
        state,
        levels=levels,
        counts=counts,
        run=run,
        illegal=state.illegal + illegal,
        repeated=state.repeated + repeated,
    )


def _account(params: QuadratureParameters, state: QuadratureState, burst: EdgeBurst) -> QuadratureState:
    """Compare the total of the board with the edges that it has sent."""
    state, total_before = replace(state, total=burst.total), state.total
    lost = 0 if total_before is None else (burst.total - total_before - len(burst.levels)) % TOTAL_SPAN
    if not lost:
        return state
    return replace(state, levels=None, run=edge_speed.break_run(params, state.run), lost=state.lost + lost)


def misses_edges(before: QuadratureState, after: QuadratureState) -> bool:
    """Whether edges were lost between these two states, so that the counts fall short."""
    return after.lost > before.lost or after.illegal > before.illegal


def rate_counts_s(params: QuadratureParameters, state: QuadratureState, board_s: float) -> float:
    """Counts per second at ``board_s``, forward positive."""
    return edge_speed.rate_counts_s(params, state.run, board_s)
