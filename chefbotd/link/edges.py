"""The quadrature edges of a cycle, until the `t` line that closes it has come."""

from collections import deque
from itertools import accumulate

from chefbotd.core.events import EdgeBurst
from chefbotd.link.board_clock import BoardClock
from firmware_protocol.messages import QuadratureEdges, QuadratureStill

MOST_BURSTS = 256
"""A board whose `t` lines are all damaged must not fill the memory: beyond this the oldest bursts are lost."""


class EdgeBasket:
    """Collects bursts in the order in which they came, and dates them by the board's clock."""

    def __init__(self, clock: BoardClock) -> None:
        self._clock = clock
        self._bursts: deque[QuadratureEdges | QuadratureStill] = deque(maxlen=MOST_BURSTS)

    def put(self, burst: QuadratureEdges | QuadratureStill) -> None:
        """Keep a burst for the cycle's end."""
        self._bursts.append(burst)

    def forget(self) -> None:
        """The board restarted: what it told before belongs to another run of its clock."""
        self._bursts.clear()

    def empty(self) -> tuple[EdgeBurst, ...]:
        """Every burst collected since the last time, dated; none before the clock has been read."""
        bursts = tuple(dated for burst in self._bursts if (dated := self._dated(burst)) is not None)
        self._bursts.clear()
        return bursts

    def _dated(self, burst: QuadratureEdges | QuadratureStill) -> EdgeBurst | None:
        if isinstance(burst, QuadratureStill):
            return EdgeBurst(burst.wheel, burst.total, (), ())
        last_s = self._clock.time_of_s(burst.micros)
        if last_s is None:
            return None
        before_us = accumulate(reversed(burst.gaps_us), initial=0)
        times_s = [last_s - us * 1e-6 for us in before_us]
        return EdgeBurst(burst.wheel, burst.total, burst.states, tuple(reversed(times_s)))
