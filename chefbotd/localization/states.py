"""The states of localization as a table, with the events that change them."""

from collections.abc import Mapping
from enum import StrEnum


class State(StrEnum):
    """``unknown``: nothing looked at yet. ``searching``: looking everywhere, or telling look-alike places apart.

    ``localized``: the scans fit. ``uncertain``: they do not fit just now, or a pose was given and is not confirmed yet.
    ``lost``: it knows that it does not know, and will look again.
    """

    UNKNOWN = "unknown"
    SEARCHING = "searching"
    LOCALIZED = "localized"
    UNCERTAIN = "uncertain"
    LOST = "lost"


class Event(StrEnum):
    """What happens to localization.

    ``pose_given``: by a person, or kept from before a restart. ``found``: a search leaves one place only.
    ``not_found``: it leaves none. ``fits`` and ``misfits``: some scans in a row. ``given_up``: they misfit for long.
    """

    POSE_GIVEN = "pose_given"
    SEARCH_STARTED = "search_started"
    FOUND = "found"
    NOT_FOUND = "not_found"
    FITS = "fits"
    MISFITS = "misfits"
    GIVEN_UP = "given_up"


NEXT: Mapping[tuple[State, Event], State] = {
    (State.UNKNOWN, Event.POSE_GIVEN): State.UNCERTAIN,
    (State.UNKNOWN, Event.SEARCH_STARTED): State.SEARCHING,
    (State.UNKNOWN, Event.FOUND): State.UNKNOWN,
    (State.UNKNOWN, Event.NOT_FOUND): State.UNKNOWN,
    (State.UNKNOWN, Event.FITS): State.UNKNOWN,
    (State.UNKNOWN, Event.MISFITS): State.UNKNOWN,
    (State.UNKNOWN, Event.GIVEN_UP): State.UNKNOWN,
    (State.SEARCHING, Event.POSE_GIVEN): State.UNCERTAIN,
    (State.SEARCHING, Event.SEARCH_STARTED): State.SEARCHING,
    (State.SEARCHING, Event.FOUND): State.LOCALIZED,
    (State.SEARCHING, Event.NOT_FOUND): State.LOST,
    (State.SEARCHING, Event.FITS): State.SEARCHING,
    (State.SEARCHING, Event.MISFITS): State.SEARCHING,
    (State.SEARCHING, Event.GIVEN_UP): State.SEARCHING,
    (State.LOCALIZED, Event.POSE_GIVEN): State.UNCERTAIN,
    (State.LOCALIZED, Event.SEARCH_STARTED): State.SEARCHING,
    (State.LOCALIZED, Event.FOUND): State.LOCALIZED,
    (State.LOCALIZED, Event.NOT_FOUND): State.LOCALIZED,
    (State.LOCALIZED, Event.FITS): State.LOCALIZED,
    (State.LOCALIZED, Event.MISFITS): State.UNCERTAIN,
    (State.LOCALIZED, Event.GIVEN_UP): State.LOST,
    (State.UNCERTAIN, Event.POSE_GIVEN): State.UNCERTAIN,
    (State.UNCERTAIN, Event.SEARCH_STARTED): State.SEARCHING,
    (State.UNCERTAIN, Event.FOUND): State.UNCERTAIN,
    (State.UNCERTAIN, Event.NOT_FOUND): State.UNCERTAIN,
    (State.UNCERTAIN, Event.FITS): State.LOCALIZED,
    (State.UNCERTAIN, Event.MISFITS): State.UNCERTAIN,
    (State.UNCERTAIN, Event.GIVEN_UP): State.LOST,
    (State.LOST, Event.POSE_GIVEN): State.UNCERTAIN,
    (State.LOST, Event.SEARCH_STARTED): State.SEARCHING,
    (State.LOST, Event.FOUND): State.LOST,
    (State.LOST, Event.NOT_FOUND): State.LOST,
    (State.LOST, Event.FITS): State.LOST,
    (State.LOST, Event.MISFITS): State.LOST,
    (State.LOST, Event.GIVEN_UP): State.LOST,
}

HAS_POSE = frozenset({State.LOCALIZED, State.UNCERTAIN})
"""The states in which there is one pose that is tracked."""
