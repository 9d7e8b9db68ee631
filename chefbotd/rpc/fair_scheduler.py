"""Whose turn it is: what all clients together may cost before everything else on the loop has its turn.

A turn of the event loop has room for so many requests and for so much time, whichever is used up first, however many
clients ask. Whoever comes while there is room is served at once. The others wait in a circle, and each is served one
request when it is its turn: so a client waits for one request of every other, not for all that they have sent, and
the control loop waits for one such slice.
"""

import asyncio
from collections import deque
from typing import Protocol

from chefbotd.clock import Clock

TURN_S = 0.002
"""A control step is a few turns of the loop from its encoder frame: with a slice in each it is still in time."""


class Waiting(Protocol):
    """A client whose requests wait for their turn."""

    def turn(self) -> None:
        """Do one thing of those that wait, and wait again when there are more."""
        ...


class FairScheduler:
    """One for all clients: in a turn of the loop at most ``requests_per_turn`` are served, for ``TURN_S`` at most."""

    def __init__(self, clock: Clock, requests_per_turn: int) -> None:
        self._clock, self._requests_per_turn = clock, requests_per_turn
        self._circle: deque[Waiting] = deque()
        self._next: asyncio.Handle | None = None
        self._left, self._until_s = 0, 0.0

    def wait(self, client: Waiting) -> None:
        """Come to the end of the circle."""
        self._circle.append(client)
        self._take_the_next()

    def is_free(self) -> bool:
        """Whether a client may be served at once: there is room, and nobody waits for it; the room is then taken."""
        if self._next is None:
            self._begin()
        return not self._circle and self._has_room()

    def _has_room(self) -> bool:
        self._left -= 1
        return self._left >= 0 and self._clock.now_s() < self._until_s

    def _begin(self) -> None:
        self._left, self._until_s = self._requests_per_turn, self._clock.now_s() + TURN_S
        self._take_the_next()

    def _take_the_next(self) -> None:
        if self._next is None:
            self._next = asyncio.get_running_loop().call_soon(self._turn_of_the_loop)

    def _turn_of_the_loop(self) -> None:
        """Go round in the circle while there is room; what is left of both is there for who comes during this turn."""
        self._next = None
        if not self._circle:
            return
        self._begin()
        while self._circle and self._has_room():
            self._circle.popleft().turn()
