"""Goals outlive the worker that drives to them: the next worker is told of them, unless too many end or none comes."""

from collections.abc import Callable
from typing import Final

from chefbotd.core.events.robot import WorkerReported
from chefbotd.inputs import InputLog, Timer, due_of

MOST_WORKERS: Final = 5
"""A goal is given up when so many workers ended one after the other: it may be what ends them, or none can start."""

WORKER_AWAY_S: Final = 180.0
"""So too after so long without a worker that could be told of it."""

AWAY: Final = ("restarting", "unavailable", "stopped")
TIMER: Final = "navigation worker"


class Handover:
    """Whether the next worker ``must_tell`` of the goals, how many workers were lost, and when the goals are given up.

    ``give_up`` ends the goals for a reason.
    """

    def __init__(self, entries: InputLog, give_up: Callable[[str], None]) -> None:
        self._entries, self._give_up = entries, give_up
        self.must_tell = False
        self.workers_lost = 0  # since a goal was accepted or ended
        self._timer: Timer | None = None

    def due_s(self) -> float | None:
        """When the goals are given up, if no worker could be told of them."""
        return due_of(self._timer)

    def restore(self, must_tell: bool, workers_lost: int, due_s: float | None) -> None:
        """Go on from there."""
        self.must_tell, self.workers_lost = must_tell, workers_lost
        self._timer = self._entries.resume(due_s, self._take_timeout, TIMER)

    def forget_losses(self) -> None:
        """Count the workers that end from now on."""
        self.workers_lost = 0

    def wait(self, event: WorkerReported) -> bool:
        """The worker is away: wait for the next one. False where the goals were given up."""
        if event.state == "unavailable":
            self._give_up(f"the worker is not available: {event.reason}")
            return False
        self.workers_lost += 1
        if self.workers_lost >= MOST_WORKERS:
            self._give_up(f"{self.workers_lost} workers ended on the way to it, the last: {event.reason}")
            return False
        self.must_tell = True
        if self._timer is None:
            self._timer = self._entries.call_later(WORKER_AWAY_S, self._take_timeout, TIMER)
        return True

    def wait_no_more(self) -> None:
        """The goals are told, or over."""
        if self._timer is not None:
            self._timer.cancel()
        self.must_tell, self._timer = False, None

    def _take_timeout(self) -> None:
        self._timer = None
        self._give_up(f"no worker could take over the goal for {WORKER_AWAY_S:.0f} s")
