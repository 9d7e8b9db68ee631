"""The results of a command: what the limits allow of it, or why it is refused."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Generic, TypeVar

from chefbotd.core.record import Record
from chefbotd.core.sentence import sentence_data

T = TypeVar("T")


class Allowed(Record, Generic[T], frozen=True):
    """As much of a command as the configured limits allow; ``limited_by`` is the key of the tightest, if one is."""

    command: T
    limited_by: str | None = None


class RefusalKind(StrEnum):
    """Stable names for why a command was refused; clients branch on these."""

    DISARMED = "disarmed"
    ESTOPPED = "estopped"
    STOPPED = "stopped"
    STOPPED_SINCE = "stopped_since"
    LINK_DOWN = "link_down"
    UNKNOWN_SOURCE = "unknown_source"
    UNKNOWN_WHEEL = "unknown_wheel"
    WORKER_UNAVAILABLE = "worker_unavailable"
    NOT_MAPPING = "not_mapping"
    ALREADY_MAPPING = "already_mapping"
    OUT_OF_RANGE = "out_of_range"
    NOTHING_TO_UNDO = "nothing_to_undo"
    BAD_NAME = "bad_name"
    UNKNOWN_MAP = "unknown_map"
    MAP_EXISTS = "map_exists"
    MAP_UNREADABLE = "map_unreadable"
    NO_MAP_LOADED = "no_map_loaded"
    UNKNOWN_PLACE = "unknown_place"
    POSE_UNKNOWN = "pose_unknown"
    UNKNOWN_ZONE = "unknown_zone"
    UNKNOWN_EDIT = "unknown_edit"
    CHANGED_MEANWHILE = "changed_meanwhile"
    NEEDS_CONFIRMATION = "needs_confirmation"
    STORAGE_FAILED = "storage_failed"
    ALREADY_RECORDING = "already_recording"
    NOT_RECORDING = "not_recording"
    LATCHED_AGAIN = "latched_again"
    CANNOT_CALIBRATE = "cannot_calibrate"
    NOT_CALIBRATED = "not_calibrated"
    UNKNOWN_GOAL = "unknown_goal"
    AGENT_EXISTS = "agent_exists"
    NOT_AN_AGENT = "not_an_agent"
    UNKNOWN_AGENT = "unknown_agent"
    UNKNOWN_BUTTON = "unknown_button"
    UNKNOWN_QUESTION = "unknown_question"
    UNKNOWN_CALL = "unknown_call"
    AGENT_FAILED = "agent_failed"
    AGENT_LEFT = "agent_left"
    AGENT_TIMED_OUT = "agent_timed_out"
    CANNOT_INVITE = "cannot_invite"
    NOT_INVITED = "not_invited"
    TOO_MANY_ATTEMPTS = "too_many_attempts"
    NO_PICTURE = "no_picture"
    TOO_MANY_VIEWERS = "too_many_viewers"


class Refused(Exception):
    """A command that was understood and not carried out: nothing moved, nothing changed.

    A message that is a ``Sentence`` keeps its id and its arguments in ``words``.
    """

    def __init__(
        self, kind: RefusalKind, message: str, details: Mapping[str, str | float] | None = None
    ) -> None:
        super().__init__(message)
        self.kind, self.words, self.details = kind, message, details

    @property
    def data(self) -> dict[str, object]:
        """What the error says beside its kind and its words."""
        return {**sentence_data(self.words), **(self.details or {})}
