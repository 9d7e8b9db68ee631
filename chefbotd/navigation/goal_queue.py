"""The queue of goals: numbered, cancelled, and ended."""

from collections.abc import Collection

from chefbotd.core.record import Record, replace
from chefbotd.navigation.path import Goal
from chefbotd.navigation.reports import Ended
from chefbotd.navigation.states import End


class GoalQueue(Record, frozen=True):
    """Goals with their numbers, the present one first, and how many were ever accepted."""

    goals: tuple[tuple[int, Goal], ...] = ()
    count: int = 0

    @property
    def number(self) -> int | None:
        """The present goal's."""
        return self.goals[0][0] if self.goals else None


def added(queue: GoalQueue, goals: tuple[Goal, ...]) -> tuple[GoalQueue, tuple[int, ...]]:
    """The queue with goals behind those that are there, and their numbers."""
    numbers = tuple(range(queue.count + 1, queue.count + len(goals) + 1))
    behind = tuple(zip(numbers, goals, strict=True))
    return GoalQueue((*queue.goals, *behind), queue.count + len(goals)), numbers


def kept(queue: GoalQueue, numbers: Collection[int], reason: str) -> tuple[GoalQueue, tuple[Ended, ...]]:
    """The queue with no goals but these, and the ends of the others, which are cancelled."""
    ended = tuple(Ended(number, End.CANCELLED, reason) for number, _ in queue.goals if number not in numbers)
    left = tuple(each for each in queue.goals if each[0] in numbers)
    return replace(queue, goals=left), ended


def first_ended(queue: GoalQueue, end: End, reason: str) -> tuple[GoalQueue, tuple[Ended, ...]]:
    """The queue without its first goal; what was to follow one that was not reached makes no sense any more."""
    (number, _), *following = queue.goals
    first, left = Ended(number, end, reason), replace(queue, goals=tuple(following))
    if end is End.REACHED:
        return left, (first,)
    left, others = kept(left, (), f"cancelled: goal {number} before it ended {end}")
    return left, (first, *others)
