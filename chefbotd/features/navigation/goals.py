"""The accepted goals: those that have not ended, in order, and the ends of the others."""

import asyncio
from collections.abc import Iterable
from itertools import count

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.worker.skills.navigation_messages import GoalAsked, GoalEnded

MOST_ACTIVE, MOST_ENDED = 200, 400


class Goals:
    """``active`` are those that have not ended, by their numbers."""

    def __init__(self) -> None:
        self.active: dict[int, GoalAsked] = {}
        self._ends: dict[int, asyncio.Future[GoalEnded]] = {}
        self._numbers = count(1)

    def next_number(self) -> int:
        """A number that no goal has had."""
        return next(self._numbers)

    def require_room(self, more: int) -> None:
        """Raises ``Refused`` where so many more would be too many."""
        if len(self.active) + more > MOST_ACTIVE:
            told = f"at most {MOST_ACTIVE} goals may wait at a time: {len(self.active)} wait, got {more} more"
            raise Refused(RefusalKind.OUT_OF_RANGE, told)

    def add(self, goals: Iterable[GoalAsked]) -> None:
        """Goals that are to be told to the worker."""
        for goal in goals:
            self.active[goal.number] = goal
            self._ends[goal.number] = asyncio.get_running_loop().create_future()
        ended = [number for number in self._ends if number not in self.active]
        for number in ended[: max(0, len(ended) - MOST_ENDED)]:
            del self._ends[number]

    def forget(self, numbers: Iterable[int]) -> None:
        """Goals that were not accepted."""
        for number in numbers:
            self.active.pop(number, None)
            self._ends.pop(number, None)

    def end(self, ended: GoalEnded) -> bool:
        """A goal has ended; False: it is none of the active ones."""
        if self.active.pop(ended.number, None) is None:
            return False
        end = self._ends[ended.number]
        if not end.done():
            end.set_result(ended)
        return True

    def end_of(self, number: int) -> "asyncio.Future[GoalEnded]":
        """What will have the goal's end."""
        return self._ends[number]
