"""Encoder edges in, encoder counts out: for boards that decode nothing themselves."""

import structlog

from chefbotd.bus import Bus, Inbox
from chefbotd.core.events import BoardRestarted, EdgesSeen, EncodersCounted
from chefbotd.logs import RateLimitedLog
from chefbotd.motion import quadrature
from chefbotd.motion.edge_speed import QuadratureParameters

log = structlog.get_logger(component="quadrature")


class QuadratureService:
    """Counts every wheel's edges; a cycle becomes an ``EncodersCounted`` with the rates that the edges' times give.

    A cycle that lacks edges of a wheel is no reading: counts that fell short would be a slower motion than there is.
    """

    def __init__(self, bus: Bus, parameters: QuadratureParameters, wheel_names: tuple[str, ...]) -> None:
        self._bus, self._parameters, self._wheel_names = bus, parameters, wheel_names
        self._states = [quadrature.START] * len(wheel_names)
        self._inbox: Inbox[EdgesSeen | BoardRestarted] = bus.subscribe(EdgesSeen, BoardRestarted)
        self._log = RateLimitedLog(log)

    @property
    def illegal_transitions(self) -> int:
        """Changes of both levels at once: an edge was missed."""
        return sum(state.illegal for state in self._states)

    @property
    def repeated_levels(self) -> int:
        """Edges after which the levels were as before."""
        return sum(state.repeated for state in self._states)

    @property
    def lost_edges(self) -> int:
        """Edges that the board saw and that never came, by its own count."""
        return sum(state.lost for state in self._states)

    async def run(self) -> None:
        """Count until cancelled."""
        async for event in self._inbox:
            if isinstance(event, EdgesSeen):
                self._count(event)
            else:
                self._states = [quadrature.rebase(state) for state in self._states]

    def _count(self, event: EdgesSeen) -> None:
        before = [state.lost for state in self._states]
        for burst in event.bursts:
            self._states[burst.wheel] = quadrature.decode(self._parameters, self._states[burst.wheel], burst)
        lost = {
            name: state.lost - earlier
            for name, state, earlier in zip(self._wheel_names, self._states, before, strict=True)
            if state.lost > earlier
        }
        if lost:
            self._log.warning("edges of the encoders were lost: no reading", edges=lost)
            return
        rates = [quadrature.rate_counts_s(self._parameters, state, event.board_s) for state in self._states]
        counts = tuple(state.counts for state in self._states)
        self._bus.publish(EncodersCounted(event.stamp_s, event.board_s, counts, tuple(rates)))
