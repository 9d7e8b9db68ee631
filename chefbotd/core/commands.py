"""The results of a command: what the limits allow of it, or why it is refused."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Generic, Self, TypeVar

from chefbotd.core.record import Record
from chefbotd.core.sentence import sentence_data

T = TypeVar("T")


class Allowed(Record, Generic[T], frozen=True):
    """As much of a command as the configured limits allow; ``limited_by`` is the key of the tightest, if one is."""

    command: T
    limited_by: str | None = None


class CodedKind(StrEnum):
    """A stable name of an error on the socket: its JSON-RPC code, what it means, and whether it ends the connection."""

    code: int
    meaning: str
    closes: bool

    def __new__(cls, name: str, code: int, meaning: str, closes: bool = False) -> Self:
        """A row of the table."""
        kind = str.__new__(cls, name)
        kind._value_ = name
        kind.code, kind.meaning, kind.closes = code, meaning, closes
        return kind


class RefusalKind(CodedKind):
    """Why a command was refused; clients branch on these."""

    DISARMED = ("disarmed", -32001, "the robot is disarmed; send arm first")
    ESTOPPED = ("estopped", -32002, "the emergency stop is latched; send arm to release it")
    STOPPED = (
        "stopped",
        -32029,
        "another client's stop blocks this source until its driver releases the controls or sends arm",
    )
    STOPPED_SINCE = (
        "stopped_since",
        -32033,
        "the robot was stopped, or had a fault, after this was decided or sent; decide again, and send it again",
    )
    LINK_DOWN = ("link_down", -32003, "the board is not connected")
    UNKNOWN_SOURCE = ("unknown_source", -32004, "no such source of commands is configured")
    UNKNOWN_WHEEL = ("unknown_wheel", -32005, "no such wheel")
    WORKER_UNAVAILABLE = (
        "worker_unavailable",
        -32050,
        "the worker process is not available; the topic worker says why",
    )
    NOT_MAPPING = ("not_mapping", -32051, "no map is being made; send start_mapping")
    ALREADY_MAPPING = ("already_mapping", -32052, "another map is being made; finish or discard it first")
    OUT_OF_RANGE = ("out_of_range", -32006, "a value outside the range of this robot")
    NOTHING_TO_UNDO = ("nothing_to_undo", -32007, "there is no change to take back")
    BAD_NAME = ("bad_name", -32040, "a map or a place cannot have this name")
    UNKNOWN_MAP = ("unknown_map", -32041, "no map of this name is stored")
    MAP_EXISTS = ("map_exists", -32042, "another map has this name")
    MAP_UNREADABLE = ("map_unreadable", -32043, "a file is missing, damaged or not a map")
    NO_MAP_LOADED = ("no_map_loaded", -32044, "no map is in use; send load_map")
    UNKNOWN_PLACE = ("unknown_place", -32045, "the map has no place of this name")
    POSE_UNKNOWN = ("pose_unknown", -32046, "the robot's pose in the map is not known")
    UNKNOWN_ZONE = ("unknown_zone", -32059, "the map has no zone with this id")
    UNKNOWN_EDIT = ("unknown_edit", -32069, "the map has no edit with this id")
    CHANGED_MEANWHILE = (
        "changed_meanwhile",
        -32048,
        "somebody else changed this after it was read; read it again, and send the change again",
    )
    NEEDS_CONFIRMATION = (
        "needs_confirmation",
        -32049,
        "this has a consequence that may not be meant; send it again with confirmed, if it is",
    )
    STORAGE_FAILED = ("storage_failed", -32047, "the disk failed; what was stored before is unchanged")
    ALREADY_RECORDING = ("already_recording", -32053, "a recording is in progress; send stop_recording first")
    NOT_RECORDING = ("not_recording", -32054, "nothing is being recorded; send start_recording")
    LATCHED_AGAIN = (
        "latched_again",
        -32055,
        "the robot was stopped again by something newer than this arm was sent for; find out why, then send arm",
    )
    CANNOT_CALIBRATE = ("cannot_calibrate", -32056, "this step of the calibration cannot be begun now")
    NOT_CALIBRATED = ("not_calibrated", -32057, "no such step has passed; send calibrate")
    UNKNOWN_GOAL = ("unknown_goal", -32058, "no goal of this number or id is remembered")
    AGENT_EXISTS = ("agent_exists", -32060, "this name, or this connection, is another agent's")
    NOT_AN_AGENT = ("not_an_agent", -32061, "only agents may do this; send register_agent first")
    UNKNOWN_AGENT = ("unknown_agent", -32062, "no agent has this name, or it does not offer this method")
    UNKNOWN_BUTTON = ("unknown_button", -32063, "there is no such button")
    UNKNOWN_QUESTION = ("unknown_question", -32064, "no such question waits for an answer")
    UNKNOWN_CALL = ("unknown_call", -32065, "no such call of this agent waits for an answer")
    AGENT_FAILED = ("agent_failed", -32066, "the agent answered that it failed; the message is its own")
    AGENT_LEFT = ("agent_left", -32067, "the agent left before it answered")
    AGENT_TIMED_OUT = ("agent_timed_out", -32068, "the agent did not answer in time")
    CANNOT_INVITE = ("cannot_invite", -32070, "nobody can be invited like this; the message says why")
    NOT_INVITED = (
        "not_invited",
        -32071,
        "the invitation, or the access that it gave, does not exist or has ended",
    )
    TOO_MANY_ATTEMPTS = ("too_many_attempts", -32072, "too many codes were tried; wait, and try again")
    NO_PICTURE = ("no_picture", -32073, "the camera has sent no picture; the message says why")
    TOO_MANY_VIEWERS = ("too_many_viewers", -32074, "too many look at the camera, or one client asked twice")


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
