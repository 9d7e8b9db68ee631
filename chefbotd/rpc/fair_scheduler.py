"""Limits what all clients together may cost per iteration of the event loop, and shares it among them.

An iteration has room for a number of requests and for an amount of time, whichever is used up first, however many
clients ask. A client that asks while there is room is served at once. The others queue, and each is served one request
when it reaches the head (round robin): so a client waits for one request of every other client, not for all that they
have sent, and the control loop waits for one such slice.
"""

import asyncio
from collections import deque
from typing import Protocol

from chefbotd.clock import Clock

SLICE_S = 0.002
"""A control step takes a few loop iterations from its encoder frame: with a slice in each it is still in time."""


class Schedulable(Protocol):
    """A client with requests that wait."""

    def run_scheduled(self) -> None:
        """Serve one of the requests that wait, and queue again when there are more."""
        ...


class FairScheduler:
    """Serves at most ``requests_per_turn`` requests of all clients per loop iteration, for at most ``SLICE_S``."""

    def __init__(self, clock: Clock, requests_per_turn: int) -> None:
        self._clock, self._requests_per_turn = clock, requests_per_turn
        self._queue: deque[Schedulable] = deque()
        self._next_slice: asyncio.Handle | None = None
        self._requests_left, self._until_s = 0, 0.0

    def add(self, client: Schedulable) -> None:
        """Append a client to the queue."""
        self._queue.append(client)
        self._plan_next_slice()

    def try_acquire(self) -> bool:
        """Take room for one request in this iteration; False when there is none, or others wait for it."""
        if self._next_slice is None:
            self._begin_slice()
        return not self._queue and self._has_room()

    def _has_room(self) -> bool:
        self._requests_left -= 1
        return self._requests_left >= 0 and self._clock.now_s() < self._until_s

    def _begin_slice(self) -> None:
        self._requests_left, self._until_s = self._requests_per_turn, self._clock.now_s() + SLICE_S
        self._plan_next_slice()

    def _plan_next_slice(self) -> None:
        if self._next_slice is None:
            self._next_slice = asyncio.get_running_loop().call_soon(self._run_slice)

    def _run_slice(self) -> None:
        """Serve queued clients while there is room; clients that arrive during this iteration share what is left."""
        self._next_slice = None
        if not self._queue:
            return
        self._begin_slice()
        while self._queue and self._has_room():
            self._queue.popleft().run_scheduled()
