"""Encoder edges in, encoder counts out: for boards that decode nothing themselves."""

from chefbotd.bus import Bus, Inbox
from chefbotd.core.events import BoardRestarted, EdgesSeen, EncodersCounted
from chefbotd.motion import quadrature
from chefbotd.motion.quadrature import Edge, QuadratureParameters


class QuadratureService:
    """Counts every wheel's edges; a cycle becomes an ``EncodersCounted`` with the rates that the edges' times give."""

    def __init__(self, bus: Bus, parameters: QuadratureParameters, wheels: int) -> None:
        self._bus, self._parameters = bus, parameters
        self._states = [quadrature.START] * wheels
        self._inbox: Inbox[EdgesSeen | BoardRestarted] = bus.subscribe(
            EdgesSeen, BoardRestarted, kept=(BoardRestarted,)
        )

    @property
    def illegal_transitions(self) -> int:
        """Changes of both levels at once: edges that were lost, on the board or on the wire."""
        return sum(state.illegal for state in self._states)

    async def run(self) -> None:
        """Count until cancelled."""
        async for event in self._inbox:
            if isinstance(event, EdgesSeen):
                self._count(event)
            else:
                self._states = [quadrature.rebase(state) for state in self._states]

    def _count(self, event: EdgesSeen) -> None:
        edges: list[list[Edge]] = [[] for _ in self._states]
        for edge in event.edges:
            edges[edge.wheel].append(Edge(edge.board_s, edge.levels))
        wheels = zip(self._states, edges, strict=True)
        self._states = [quadrature.decode(self._parameters, *wheel) for wheel in wheels]
        rates = [quadrature.rate_counts_s(self._parameters, state, event.board_s) for state in self._states]
        counts = tuple(state.counts for state in self._states)
        self._bus.publish(EncodersCounted(event.stamp_s, event.board_s, counts, tuple(rates)))
