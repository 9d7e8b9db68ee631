"""The states of localization as a table, with the events that change them."""

from collections.abc import Mapping
from enum import StrEnum


class PoseState(StrEnum):
    """``unknown``: nothing looked at yet. ``searching``: looking everywhere, or telling look-alike places apart.

    ``localized``: the scans fit. ``uncertain``: they do not fit just now, or a pose was given and is not confirmed yet.
    ``lost``: it knows that it does not know, and will look again.
    """

    UNKNOWN = "unknown"
    SEARCHING = "searching"
    LOCALIZED = "localized"
    UNCERTAIN = "uncertain"
    LOST = "lost"


class PoseEvent(StrEnum):
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


NEXT: Mapping[tuple[PoseState, PoseEvent], PoseState] = {
    (PoseState.UNKNOWN, PoseEvent.POSE_GIVEN): PoseState.UNCERTAIN,
    (PoseState.UNKNOWN, PoseEvent.SEARCH_STARTED): PoseState.SEARCHING,
    (PoseState.UNKNOWN, PoseEvent.FOUND): PoseState.UNKNOWN,
    (PoseState.UNKNOWN, PoseEvent.NOT_FOUND): PoseState.UNKNOWN,
    (PoseState.UNKNOWN, PoseEvent.FITS): PoseState.UNKNOWN,
    (PoseState.UNKNOWN, PoseEvent.MISFITS): PoseState.UNKNOWN,
    (PoseState.UNKNOWN, PoseEvent.GIVEN_UP): PoseState.UNKNOWN,
    (PoseState.SEARCHING, PoseEvent.POSE_GIVEN): PoseState.UNCERTAIN,
    (PoseState.SEARCHING, PoseEvent.SEARCH_STARTED): PoseState.SEARCHING,
    (PoseState.SEARCHING, PoseEvent.FOUND): PoseState.LOCALIZED,
    (PoseState.SEARCHING, PoseEvent.NOT_FOUND): PoseState.LOST,
    (PoseState.SEARCHING, PoseEvent.FITS): PoseState.SEARCHING,
    (PoseState.SEARCHING, PoseEvent.MISFITS): PoseState.SEARCHING,
    (PoseState.SEARCHING, PoseEvent.GIVEN_UP): PoseState.SEARCHING,
    (PoseState.LOCALIZED, PoseEvent.POSE_GIVEN): PoseState.UNCERTAIN,
    (PoseState.LOCALIZED, PoseEvent.SEARCH_STARTED): PoseState.SEARCHING,
    (PoseState.LOCALIZED, PoseEvent.FOUND): PoseState.LOCALIZED,
    (PoseState.LOCALIZED, PoseEvent.NOT_FOUND): PoseState.LOCALIZED,
    (PoseState.LOCALIZED, PoseEvent.FITS): PoseState.LOCALIZED,
    (PoseState.LOCALIZED, PoseEvent.MISFITS): PoseState.UNCERTAIN,
    (PoseState.LOCALIZED, PoseEvent.GIVEN_UP): PoseState.LOST,
    (PoseState.UNCERTAIN, PoseEvent.POSE_GIVEN): PoseState.UNCERTAIN,
    (PoseState.UNCERTAIN, PoseEvent.SEARCH_STARTED): PoseState.SEARCHING,
    (PoseState.UNCERTAIN, PoseEvent.FOUND): PoseState.UNCERTAIN,
    (PoseState.UNCERTAIN, PoseEvent.NOT_FOUND): PoseState.UNCERTAIN,
    (PoseState.UNCERTAIN, PoseEvent.FITS): PoseState.LOCALIZED,
    (PoseState.UNCERTAIN, PoseEvent.MISFITS): PoseState.UNCERTAIN,
    (PoseState.UNCERTAIN, PoseEvent.GIVEN_UP): PoseState.LOST,
    (PoseState.LOST, PoseEvent.POSE_GIVEN): PoseState.UNCERTAIN,
    (PoseState.LOST, PoseEvent.SEARCH_STARTED): PoseState.SEARCHING,
    (PoseState.LOST, PoseEvent.FOUND): PoseState.LOST,
    (PoseState.LOST, PoseEvent.NOT_FOUND): PoseState.LOST,
    (PoseState.LOST, PoseEvent.FITS): PoseState.LOST,
    (PoseState.LOST, PoseEvent.MISFITS): PoseState.LOST,
    (PoseState.LOST, PoseEvent.GIVEN_UP): PoseState.LOST,
}

HAS_POSE = frozenset({PoseState.LOCALIZED, PoseState.UNCERTAIN})
"""The states in which there is one pose that is tracked."""
