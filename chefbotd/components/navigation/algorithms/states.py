"""The states of a goal, its ends, and the transitions between them; how unknown space is driven."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final

from chefbotd.core.sentence import Sentence


class UnknownSpace(StrEnum):
    """What cells are worth that the map knows nothing of: no way, a way at a high price, or one like any other."""

    BLOCKED = "blocked"
    AVOIDED = "avoided"
    FREE = "free"


class GoalState(StrEnum):
    """What navigation does."""

    IDLE = "idle"
    PLANNING = "planning"
    DRIVING = "driving"
    RECOVERING = "recovering"
    PAUSED = "paused"


class GoalEvent(StrEnum):
    """What changes it."""

    GOAL_ACCEPTED = "goal_accepted"
    PATH_FOUND = "path_found"
    STUCK = "stuck"
    PAUSED = "paused"
    RESUMED = "resumed"
    GOAL_REPLACED = "goal_replaced"
    GOAL_ENDED = "goal_ended"


class End(StrEnum):
    """How a goal ends; each comes with a sentence."""

    REACHED = "reached"
    UNREACHABLE = "unreachable"
    BLOCKED = "blocked"
    CANCELLED = "cancelled"
    LOST = "lost"
    FAULT = "fault"


FAILED: Final = frozenset({End.UNREACHABLE, End.BLOCKED, End.LOST, End.FAULT})
"""The ends that nobody asked for."""

END_WORDS: Final[Mapping[str, Sentence]] = {
    End.REACHED: Sentence("navigation.end_reached", "reached"),
    End.UNREACHABLE: Sentence("navigation.end_unreachable", "unreachable"),
    End.BLOCKED: Sentence("navigation.end_blocked", "blocked"),
    End.CANCELLED: Sentence("navigation.end_cancelled", "cancelled"),
    End.LOST: Sentence("navigation.end_lost", "lost"),
    End.FAULT: Sentence("navigation.end_fault", "fault"),
}


def cancelled(why: str) -> Sentence:
    """The reason of a goal that was cancelled."""
    return Sentence("navigation.cancelled", "cancelled: {why}", why=why)


def cancelled_before(number: int, end: str) -> Sentence:
    """The reason of a goal that was to follow another, which was not reached."""
    return Sentence(
        "navigation.cancelled_before",
        "cancelled: goal {number} before it ended {end}",
        number=number,
        end=END_WORDS[end],
    )


def failed(why: str) -> Sentence:
    """The reason of a goal that ended by a fault."""
    return Sentence("navigation.fault", "fault: {why}", why=why)


NEXT = {
    (GoalState.IDLE, GoalEvent.GOAL_ACCEPTED): GoalState.PLANNING,
    (GoalState.PLANNING, GoalEvent.PATH_FOUND): GoalState.DRIVING,
    (GoalState.PLANNING, GoalEvent.STUCK): GoalState.RECOVERING,
    (GoalState.PLANNING, GoalEvent.PAUSED): GoalState.PAUSED,
    (GoalState.PLANNING, GoalEvent.GOAL_ENDED): GoalState.IDLE,
    (GoalState.PLANNING, GoalEvent.GOAL_REPLACED): GoalState.PLANNING,
    (GoalState.DRIVING, GoalEvent.GOAL_REPLACED): GoalState.PLANNING,
    (GoalState.RECOVERING, GoalEvent.GOAL_REPLACED): GoalState.PLANNING,
    (GoalState.PAUSED, GoalEvent.GOAL_REPLACED): GoalState.PLANNING,
    (GoalState.DRIVING, GoalEvent.PATH_FOUND): GoalState.DRIVING,
    (GoalState.DRIVING, GoalEvent.STUCK): GoalState.RECOVERING,
    (GoalState.DRIVING, GoalEvent.PAUSED): GoalState.PAUSED,
    (GoalState.DRIVING, GoalEvent.GOAL_ENDED): GoalState.IDLE,
    (GoalState.RECOVERING, GoalEvent.PATH_FOUND): GoalState.DRIVING,
    (GoalState.RECOVERING, GoalEvent.PAUSED): GoalState.PAUSED,
    (GoalState.RECOVERING, GoalEvent.GOAL_ENDED): GoalState.IDLE,
    (GoalState.PAUSED, GoalEvent.RESUMED): GoalState.PLANNING,
    (GoalState.PAUSED, GoalEvent.GOAL_ENDED): GoalState.IDLE,
}


def next_state(state: GoalState, event: GoalEvent) -> GoalState:
    """The state after an event.

    Raises:
        ValueError: there is no such step.
    """
    if (state, event) not in NEXT:
        raise ValueError(f"no step leads on from {state} with {event}")
    return NEXT[state, event]
