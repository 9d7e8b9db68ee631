"""Goals outlive the worker that drives to them: the next worker is told of them, unless too many end or none comes."""

from collections.abc import Callable
from typing import Final

from chefbotd.core.events.robot import WorkerReported
from chefbotd.core.record import MutableState
from chefbotd.core.sentence import Sentence
from chefbotd.inputs import InputLog, ResumableTimer

MOST_WORKERS: Final = 5
"""A goal is given up when so many workers ended one after the other: it may be what ends them, or none can start."""

WORKER_AWAY_S: Final = 180.0
"""So too after so long without a worker that could be told of it."""

AWAY: Final = ("restarting", "unavailable", "stopped")
TIMER: Final = "navigation worker"


class HandoverState(MutableState):
    """Whether the next worker must be told of the goals, how many were lost since one was accepted or has ended.

    ``due_s`` is when the goals are given up, if no worker could be told of them.
    """

    must_tell_goals: bool = False
    workers_lost: int = 0
    due_s: float | None = None


class Handover:
    """Keeps the ``memory`` of the goals' handover from one worker to the next; ``give_up`` ends them for a reason."""

    def __init__(self, entries: InputLog, memory: HandoverState, give_up: Callable[[str], None]) -> None:
        self._memory, self._give_up = memory, give_up
        self.timer = ResumableTimer(entries, self._take_timeout, TIMER)

    def forget_losses(self) -> None:
        """Count the workers that end from now on."""
        self._memory.workers_lost = 0

    def wait(self, event: WorkerReported) -> bool:
        """The worker is away: wait for the next one. False where the goals were given up."""
        if event.state == "unavailable":
            self._give_up(
                Sentence("navigation.no_worker", "the worker is not available: {why}", why=event.reason)
            )
            return False
        self._memory.workers_lost += 1
        if self._memory.workers_lost >= MOST_WORKERS:
            self._give_up(
                Sentence(
                    "navigation.workers_ended",
                    "{count} workers ended on the way to it, the last: {why}",
                    count=self._memory.workers_lost,
                    why=event.reason,
                )
            )
            return False
        self._memory.must_tell_goals = True
        if self.timer.due_s is None:
            self.timer.start(WORKER_AWAY_S)
        return True

    def wait_no_more(self) -> None:
        """The goals are told, or over."""
        self.timer.cancel()
        self._memory.must_tell_goals = False

    def _take_timeout(self) -> None:
        self._give_up(f"no worker could take over the goal for {WORKER_AWAY_S:.0f} s")
