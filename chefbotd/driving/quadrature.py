"""Makes encoder counts from edges, for boards that decode nothing themselves."""

import math

import structlog

from chefbotd.bus import Bus, HandlerFailure
from chefbotd.core.events import BoardRestarted, EdgeBurst, EdgesSeen, EncodersCounted
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.logs import RateLimitedLog
from chefbotd.motion import quadrature
from chefbotd.motion.edge_speed import QuadratureParameters
from chefbotd.motion.quadrature import QuadratureState

log = structlog.get_logger(component="quadrature")

MOST_DOUBTFUL = 10
"""After so many incomplete cycles, less those that were complete, a complete one alone is no reading either."""

SLACK_S = 0.001
"""The tolerance of a cycle's end: a board may see an edge while it reads its clock."""


class EdgesState(MutableState):
    """The decoder's state of each wheel, the end of the last cycle, and the cycles in doubt."""

    wheels: list[QuadratureState]
    since_s: float | None = None
    doubtful: int = 0


class QuadratureService(StatefulPart[EdgesState]):
    """Counts every wheel's edges; a cycle becomes an ``EncodersCounted`` with the rates that the edges' times give.

    A cycle that lacks a wheel or some of its edges gives no reading, as the motion would look too slow. The next
    complete cycle includes it, unless most cycles of late were incomplete: a few good ones do not make up for those.
    """

    def __init__(self, bus: Bus, parameters: QuadratureParameters, wheel_names: tuple[str, ...]) -> None:
        self._bus, self._parameters, self._wheel_names = bus, parameters, wheel_names
        self.memory = EdgesState([quadrature.START] * len(wheel_names))
        self._failure = HandlerFailure()
        bus.add_handler(self._count_edges, EdgesSeen, on_error=self._failure.report)
        bus.add_handler(self._rebase, BoardRestarted, on_error=self._failure.report)
        self._log = RateLimitedLog(log)

    @property
    def illegal_transitions(self) -> int:
        """How often both levels changed at once, because an edge was missed."""
        return sum(state.illegal for state in self.memory.wheels)

    @property
    def repeated_levels(self) -> int:
        """How often an edge left the levels unchanged."""
        return sum(state.repeated for state in self.memory.wheels)

    @property
    def lost_edges(self) -> int:
        """The edges that the board counted and that were not received."""
        return sum(state.lost for state in self.memory.wheels)

    async def run(self) -> None:
        """Raise the error of edges that could not be counted; edges are counted as they are published."""
        await self._failure.wait()

    def _rebase(self, event: BoardRestarted) -> None:
        self.memory.wheels = [quadrature.rebase(state) for state in self.memory.wheels]
        self.memory.since_s, self.memory.doubtful = None, 0

    def _count_edges(self, event: EdgesSeen) -> None:
        before = self.memory.wheels.copy()
        bursts = [burst for burst in event.bursts if self._lies_within(event.board_s, burst)]
        self.memory.since_s = event.board_s
        for burst in bursts:
            state = self.memory.wheels[burst.wheel]
            self.memory.wheels[burst.wheel] = quadrature.decode(self._parameters, state, burst)
        counted = {burst.wheel for burst in bursts}
        doubtful = [
            name
            for wheel, name in enumerate(self._wheel_names)
            if wheel not in counted or quadrature.misses_edges(before[wheel], self.memory.wheels[wheel])
        ]
        if doubtful or len(bursts) < len(event.bursts):
            self.memory.doubtful = min(self.memory.doubtful + 1, 2 * MOST_DOUBTFUL)
            self._log.warning("encoder edges were lost, so this cycle has no reading", wheels=doubtful)
            return
        if self.memory.doubtful:
            self.memory.doubtful -= 1
            if self.memory.doubtful >= MOST_DOUBTFUL:
                return
        rates = [
            quadrature.rate_counts_s(self._parameters, state, event.board_s) for state in self.memory.wheels
        ]
        counts = tuple(state.counts for state in self.memory.wheels)
        self._bus.publish(
            EncodersCounted(event.stamp_s, event.arrival_s, event.board_s, counts, tuple(rates))
        )

    def _lies_within(self, until_s: float, burst: EdgeBurst) -> bool:
        """Whether the edges' times lie in their cycle; damaged times would show another speed."""
        if not burst.times_s:
            return True
        since_s = -math.inf if self.memory.since_s is None else self.memory.since_s
        return since_s - SLACK_S <= burst.times_s[0] and burst.times_s[-1] <= until_s + SLACK_S
