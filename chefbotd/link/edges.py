"""The quadrature edges of a cycle, until the `t` line that closes it has come."""

from collections import deque
from itertools import accumulate

from chefbotd.core.events import WheelEdge
from chefbotd.link.board_clock import BoardClock
from firmware_protocol.messages import QuadratureEdges

MOST_BURSTS = 1024
"""A board whose `t` lines are all damaged must not fill the memory: beyond this the oldest bursts are lost."""


class EdgeBasket:
    """Collects bursts in the order in which they came, and dates them by the board's clock."""

    def __init__(self, clock: BoardClock) -> None:
        self._clock = clock
        self._bursts: deque[QuadratureEdges] = deque(maxlen=MOST_BURSTS)

    def put(self, burst: QuadratureEdges) -> None:
        """Keep a burst for the cycle's end."""
        self._bursts.append(burst)

    def forget(self) -> None:
        """The board restarted: what it told before belongs to another run of its clock."""
        self._bursts.clear()

    def empty(self) -> tuple[WheelEdge, ...]:
        """Every edge collected since the last time, dated; none before the clock has been read."""
        edges = tuple(edge for burst in self._bursts for edge in self._dated(burst))
        self._bursts.clear()
        return edges

    def _dated(self, burst: QuadratureEdges) -> list[WheelEdge]:
        first_s = self._clock.time_of_s(burst.micros)
        if first_s is None:
            return []
        after_us = accumulate(burst.gaps_us, initial=0)
        return [
            WheelEdge(burst.wheel, first_s + us * 1e-6, levels)
            for us, levels in zip(after_us, burst.states, strict=True)
        ]
