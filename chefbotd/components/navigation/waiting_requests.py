"""Requests that wait for the end of goals; one that is given up ends them."""

import asyncio
from collections.abc import Callable, Sequence
from functools import partial

from chefbotd.components.navigation.events import GoalResult
from chefbotd.components.navigation.goals import Goals
from chefbotd.components.navigation.reporting import Reporting
from chefbotd.core.record import Record, StatefulValue
from chefbotd.features.feature import Waiting
from chefbotd.inputs import InputLog
from chefbotd.rpc.jobs import ProgressReporter


class Wait(Record, frozen=True):
    """A request that waits: for which goals, and whose it is."""

    goals: tuple[int, ...]
    client: int


class WaitingRequests(StatefulValue[dict[str, Wait]]):
    """The requests that wait, by their tasks; ``cancel`` ends the goals of a client whose request was given up."""

    def __init__(
        self,
        entries: InputLog,
        goals: Goals,
        reporting: Reporting,
        cancel: Callable[[int, Sequence[int]], None],
    ) -> None:
        self._entries, self._goals, self._reporting, self._cancel = entries, goals, reporting, cancel
        self.memory = {}

    async def wait(self, goals: Sequence[int], progress: ProgressReporter, client: int) -> GoalResult:
        """Wait for the end of these; that of the first that is not reached, or of the last.

        Given up, it ends the goals, unless they are another client's by now, or nobody's.
        """
        ends = [self._goals.end_of(number) for number in goals]
        task = self._entries.task
        self.memory[task] = Wait(tuple(goals), client)
        try:
            with self._reporting.telling(goals, progress):
                for end in ends:
                    ended = await asyncio.shield(end)
                    if ended.end != "reached":
                        break
        except asyncio.CancelledError:
            self._cancel(client, goals)
            raise
        finally:
            self.memory.pop(task, None)
        return ended

    def waiting(self) -> Waiting:
        """The requests that wait for the end of goals, by their tasks."""
        return {
            task: partial(self.wait, wait.goals, client=wait.client) for task, wait in self.memory.items()
        }
