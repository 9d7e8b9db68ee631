"""The accepted goals: those that have not ended, in order, and the ends of the others."""

import asyncio
from collections.abc import Iterable

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.navigation import GoalResult
from chefbotd.core.record import Record
from chefbotd.worker.skills.navigation_requests import GoalAsked

MOST_ACTIVE, MOST_ENDED = 200, 400


class GoalsState(Record, frozen=True):
    """The goals that have not ended, in order, the ends of the others, and the last number that was given."""

    active: list[GoalAsked]
    ended: list[GoalResult]
    last_number: int


class Goals:
    """``active`` are those that have not ended, by their numbers."""

    def __init__(self) -> None:
        self.active: dict[int, GoalAsked] = {}
        self._ends: dict[int, asyncio.Future[GoalResult]] = {}
        self._last_number = 0

    def state(self) -> GoalsState:
        """What it remembers."""
        ended = [end.result() for end in self._ends.values() if end.done()]
        return GoalsState(list(self.active.values()), ended, self._last_number)

    def restore(self, state: GoalsState) -> None:
        """Go on from there."""
        self.active, self._ends, self._last_number = {}, {}, state.last_number
        for ended in state.ended:
            self._ends[ended.goal] = asyncio.get_running_loop().create_future()
            self._ends[ended.goal].set_result(ended)
        self.add(state.active)

    def next_number(self) -> int:
        """A number that no goal has had."""
        self._last_number += 1
        return self._last_number

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

    def end(self, ended: GoalResult) -> bool:
        """A goal has ended; False: it is none of the active ones."""
        if self.active.pop(ended.goal, None) is None:
            return False
        end = self._ends[ended.goal]
        if not end.done():
            end.set_result(ended)
        return True

    def end_of(self, number: int) -> "asyncio.Future[GoalResult]":
        """What will have the goal's end."""
        return self._ends[number]
