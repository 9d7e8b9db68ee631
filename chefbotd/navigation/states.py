"""The states of a goal, its ends, and the transitions between them; how unknown space is driven."""

from enum import StrEnum


class UnknownSpace(StrEnum):
    """What cells are worth that the map knows nothing of: no way, a way at a high price, or one like any other."""

    BLOCKED = "blocked"
    AVOIDED = "avoided"
    FREE = "free"


class State(StrEnum):
    """What navigation does."""

    IDLE = "idle"
    PLANNING = "planning"
    DRIVING = "driving"
    RECOVERING = "recovering"
    PAUSED = "paused"


class Event(StrEnum):
    """What changes it."""

    GOAL_ACCEPTED = "goal_accepted"
    PATH_FOUND = "path_found"
    STUCK = "stuck"
    PAUSED = "paused"
    RESUMED = "resumed"
    GOAL_ENDED = "goal_ended"


class End(StrEnum):
    """How a goal ends; each comes with a sentence."""

    REACHED = "reached"
    UNREACHABLE = "unreachable"
    BLOCKED = "blocked"
    CANCELLED = "cancelled"
    LOST = "lost"
    FAULT = "fault"


NEXT = {
    (State.IDLE, Event.GOAL_ACCEPTED): State.PLANNING,
    (State.PLANNING, Event.PATH_FOUND): State.DRIVING,
    (State.PLANNING, Event.STUCK): State.RECOVERING,
    (State.PLANNING, Event.PAUSED): State.PAUSED,
    (State.PLANNING, Event.GOAL_ENDED): State.IDLE,
    (State.DRIVING, Event.PATH_FOUND): State.DRIVING,
    (State.DRIVING, Event.STUCK): State.RECOVERING,
    (State.DRIVING, Event.PAUSED): State.PAUSED,
    (State.DRIVING, Event.GOAL_ENDED): State.IDLE,
    (State.RECOVERING, Event.PATH_FOUND): State.DRIVING,
    (State.RECOVERING, Event.PAUSED): State.PAUSED,
    (State.RECOVERING, Event.GOAL_ENDED): State.IDLE,
    (State.PAUSED, Event.RESUMED): State.PLANNING,
    (State.PAUSED, Event.GOAL_ENDED): State.IDLE,
}


def next_state(state: State, event: Event) -> State:
    """The state after an event.

    Raises:
        ValueError: there is no such step.
    """
    if (state, event) not in NEXT:
        raise ValueError(f"no step leads on from {state} with {event}")
    return NEXT[state, event]
