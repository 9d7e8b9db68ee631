"""The messages of VDA 5050 as records, for robots and for what manages them; nothing here knows a robot.

A field's name on the wire of version 2.1 is its name here in camelCase; ``versions`` has what 3.0 calls it. The version
that a message names says how it is read and written. An optional field that is None is not sent. Sections are those of
version 2.1.0.
"""

from enum import StrEnum
from math import pi
from typing import Annotated, Any, Final, TypeVar

import msgspec
from msgspec import Meta, Struct, field

from chefbot_vda5050 import versions
from chefbot_vda5050.unset import without_unset

Count = Annotated[int, Meta(ge=0)]
Angle = Annotated[float, Meta(ge=-pi - 1e-6, le=pi + 1e-6)]
NotNegative = Annotated[float, Meta(ge=0)]

LONGEST_ID: Final = 256
LONGEST_MESSAGE: Final = 4 << 20
"""Letters and bytes: what is longer is malformed. An order of a thousand nodes has 400 kB."""

LONGEST_LIST: Final = 2000
"""InputLog of a list: an order has at most 1000 nodes, and as many edges."""

MOST_ENTRIES: Final = 20_000
"""Of all lists of a message together."""

Id = Annotated[str, Meta(max_length=LONGEST_ID)]
Name = Annotated[str, Meta(min_length=1, max_length=LONGEST_ID)]


class Message(Struct, frozen=True, kw_only=True, omit_defaults=True, rename="camel"):
    """The base of all messages and of their parts."""


class Header(Message, frozen=True, kw_only=True):
    """What every message begins with (6.4). ``timestamp`` is in UTC, ISO 8601."""

    header_id: Count
    timestamp: str
    version: str
    manufacturer: str
    serial_number: str


class BlockingType(StrEnum):
    """What may happen beside an action (6.12); SINGLE, of version 3.0: driving, and no other action."""

    NONE = "NONE"
    SINGLE = "SINGLE"
    SOFT = "SOFT"
    HARD = "HARD"


class ActionParameter(Message, frozen=True, kw_only=True):
    """A parameter of an action."""

    key: str
    value: Any


class Action(Message, frozen=True, kw_only=True):
    """Something that a robot does on a node or an edge, or at once; ``retriable`` is of version 3.0."""

    action_type: Id
    action_id: Id
    blocking_type: BlockingType
    action_description: str | None = None
    action_parameters: tuple[ActionParameter, ...] | None = None
    retriable: bool = False

    def parameter(self, key: str) -> Any:
        """The value of a parameter; None: there is none of this key."""
        return next((one.value for one in self.action_parameters or () if one.key == key), None)


class NodePosition(Message, frozen=True, kw_only=True):
    """Where a node is, in metres, and its heading (CCW positive). Of 3.0's ellipse the smaller axis counts."""

    x: float
    y: float
    map_id: Id
    theta: Angle | None = None
    allowed_deviation_xy: NotNegative | None = field(default=None, name="allowedDeviationXY")
    allowed_deviation_theta: NotNegative | None = None
    map_description: str | None = None


class Node(Message, frozen=True, kw_only=True):
    """A node of an order; ``released``: it belongs to the base."""

    node_id: Id
    sequence_id: Count
    released: bool
    actions: tuple[Action, ...]
    node_position: NodePosition | None = None
    node_description: str | None = None


class Edge(Message, frozen=True, kw_only=True):
    """An edge of an order. ``reach_orientation_before_entering`` is what 3.0 has for ``rotation_allowed``."""

    edge_id: Id
    sequence_id: Count
    released: bool
    start_node_id: Id
    end_node_id: Id
    actions: tuple[Action, ...]
    edge_description: str | None = None
    max_speed: float | None = None
    max_height: float | None = None
    min_height: float | None = None
    orientation: Angle | None = None
    orientation_type: str | None = None
    direction: str | None = None
    rotation_allowed: bool | None = None
    reach_orientation_before_entering: bool | None = None
    max_rotation_speed: float | None = None
    length: float | None = None
    trajectory: dict[str, Any] | None = None
    corridor: dict[str, Any] | None = None


class Order(Header, frozen=True, kw_only=True):
    """The topic ``order`` (6.6)."""

    order_id: Name
    order_update_id: Count
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    zone_set_id: str | None = None


class InstantActions(Header, frozen=True, kw_only=True):
    """The topic ``instantActions`` (6.9)."""

    actions: tuple[Action, ...]


class NodeState(Message, frozen=True, kw_only=True):
    """A node that the robot has still to reach."""

    node_id: Id
    sequence_id: Count
    released: bool
    node_position: NodePosition | None = None


class EdgeState(Message, frozen=True, kw_only=True):
    """An edge that the robot has still to drive along."""

    edge_id: Id
    sequence_id: Count
    released: bool


class ActionStatus(StrEnum):
    """How far an action is (6.11). PAUSED is in the text of 2.1 and not in its schema; RETRIABLE is of 3.0."""

    WAITING = "WAITING"
    INITIALIZING = "INITIALIZING"
    RUNNING = "RUNNING"
    PAUSED = "PAUSED"
    RETRIABLE = "RETRIABLE"
    FINISHED = "FINISHED"
    FAILED = "FAILED"


ENDED: Final = frozenset({ActionStatus.FINISHED, ActionStatus.FAILED})


class ActionState(Message, frozen=True, kw_only=True):
    """An action of the order or an instant one, and how far it is."""

    action_id: Id
    action_status: ActionStatus
    action_type: Id | None = None
    action_description: str | None = None
    result_description: str | None = None


class Position(Message, frozen=True, kw_only=True):
    """Where the robot is on a map."""

    x: float
    y: float
    theta: float
    map_id: Id
    position_initialized: bool
    localization_score: float | None = None
    deviation_range: float | None = None


class Velocity(Message, frozen=True, kw_only=True):
    """How the robot moves, in its own coordinates."""

    vx: float | None = None
    vy: float | None = None
    omega: float | None = None


class Load(Message, frozen=True, kw_only=True):
    """What the robot carries."""

    load_id: str | None = None
    load_type: str | None = None
    load_position: str | None = None
    weight: float | None = None


class BatteryState(Message, frozen=True, kw_only=True):
    """The battery; ``battery_charge`` in percent."""

    battery_charge: float
    charging: bool
    battery_voltage: float | None = None
    reach: int | None = None


class Level(StrEnum):
    """How bad an error is: WARNING goes by itself, FATAL needs somebody (6.10.5); the others are of 3.0 (6.6.5.1)."""

    WARNING = "WARNING"
    URGENT = "URGENT"
    CRITICAL = "CRITICAL"
    FATAL = "FATAL"


class Reference(Message, frozen=True, kw_only=True):
    """What an error is about."""

    reference_key: str
    reference_value: str


class Error(Message, frozen=True, kw_only=True):
    """Something that is wrong, and what to do about it."""

    error_type: str
    error_level: Level
    error_references: tuple[Reference, ...] | None = None
    error_description: str | None = None
    error_hint: str | None = None


class InfoLevel(StrEnum):
    """Whom an information is for."""

    DEBUG = "DEBUG"
    INFO = "INFO"


class Info(Message, frozen=True, kw_only=True):
    """Something for people to know."""

    info_type: str
    info_level: InfoLevel
    info_references: tuple[Reference, ...] | None = None
    info_description: str | None = None


class EStop(StrEnum):
    """How an emergency stop is released; NONE: there is none."""

    AUTOACK = "AUTOACK"
    MANUAL = "MANUAL"
    REMOTE = "REMOTE"
    NONE = "NONE"


class SafetyState(Message, frozen=True, kw_only=True):
    """What keeps the robot from harm."""

    e_stop: EStop
    field_violation: bool


class OperatingMode(StrEnum):
    """Who drives the robot; STARTUP and INTERVENED (by hand for now, the order is kept) are of 3.0 (6.6.6)."""

    STARTUP = "STARTUP"
    AUTOMATIC = "AUTOMATIC"
    SEMIAUTOMATIC = "SEMIAUTOMATIC"
    INTERVENED = "INTERVENED"
    MANUAL = "MANUAL"
    SERVICE = "SERVICE"
    TEACHIN = "TEACHIN"


class State(Header, frozen=True, kw_only=True):
    """The topic ``state`` (6.10).

    Version 2.1 has the states of instant actions among ``action_states``; the paths are of 3.0 (6.8).
    """

    order_id: Id
    order_update_id: Count
    last_node_id: Id
    last_node_sequence_id: Count
    driving: bool
    operating_mode: OperatingMode
    node_states: tuple[NodeState, ...]
    edge_states: tuple[EdgeState, ...]
    action_states: tuple[ActionState, ...]
    battery_state: BatteryState
    errors: tuple[Error, ...]
    safety_state: SafetyState
    paused: bool | None = None
    new_base_request: bool | None = None
    agv_position: Position | None = None
    velocity: Velocity | None = None
    loads: tuple[Load, ...] | None = None
    information: tuple[Info, ...] | None = None
    instant_action_states: tuple[ActionState, ...] = ()
    planned_path: dict[str, Any] | None = None
    intermediate_path: dict[str, Any] | None = None

    @property
    def all_action_states(self) -> tuple[ActionState, ...]:
        """Those of the order and the instant ones."""
        return (*self.action_states, *self.instant_action_states)


class Visualization(Header, frozen=True, kw_only=True):
    """The topic ``visualization`` (6.13); ``reference_state_header_id`` is of 3.0."""

    agv_position: Position | None = None
    velocity: Velocity | None = None
    reference_state_header_id: Count | None = None
    planned_path: dict[str, Any] | None = None
    intermediate_path: dict[str, Any] | None = None


class ConnectionState(StrEnum):
    """Whether a robot is connected to the broker; HIBERNATING is of 3.0."""

    ONLINE = "ONLINE"
    OFFLINE = "OFFLINE"
    HIBERNATING = "HIBERNATING"
    BROKEN = "CONNECTIONBROKEN"


class Connection(Header, frozen=True, kw_only=True):
    """The topic ``connection`` (6.14)."""

    connection_state: ConnectionState


class Factsheet(Header, frozen=True, kw_only=True):
    """The topic ``factsheet`` (6.15.1): objects as the standard lists them."""

    type_specification: dict[str, Any]
    physical_parameters: dict[str, Any]
    protocol_limits: dict[str, Any]
    protocol_features: dict[str, Any]
    agv_geometry: dict[str, Any]
    load_specification: dict[str, Any]
    vehicle_config: dict[str, Any] | None = None


class MalformedMessage(ValueError):
    """What came is no message of this topic; the text says where and why."""


M = TypeVar("M", bound=Message)


def decode(data: bytes, kind: type[M]) -> M:
    """The message in these bytes, of the version that it names.

    Raises:
        MalformedMessage: they are no JSON or too many, a field is missing, or it has another type, range or length.
    """
    version = versions.V2
    if len(data) > LONGEST_MESSAGE:
        raise MalformedMessage(f"it has {len(data)} bytes, expected at most {LONGEST_MESSAGE}")
    try:
        value = msgspec.json.decode(data)
        if kind is InstantActions and isinstance(value, dict) and "actions" not in value:
            value["actions"] = value.get(
                "instantActions"
            )  # what version 1.1, and some masters of 2.0, call it
        version = versions.of_message(value)
        _check_lengths(value)
        return msgspec.convert(without_unset(version.read(value, kind.__name__)), kind)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise MalformedMessage(version.in_words(str(error))) from error


def _check_lengths(content: Any) -> None:
    """Raise ``MalformedMessage`` for lists that are longer than any that are meant: a reader goes through all."""
    parts, entries = [("the message", content)], 0
    while parts:
        name, part = parts.pop()
        if isinstance(part, dict):
            parts.extend(part.items())
        elif isinstance(part, list):
            entries += len(part)
            if len(part) > LONGEST_LIST or entries > MOST_ENTRIES:
                most = LONGEST_LIST if len(part) > LONGEST_LIST else MOST_ENTRIES
                count = len(part) if len(part) > LONGEST_LIST else entries
                raise MalformedMessage(f"{name} has {count} entries, expected at most {most}")
            parts.extend((name, one) for one in part)


def encode(message: Message) -> bytes:
    """The message as JSON, in the version that it names."""
    version = versions.of(getattr(message, "version", ""))
    return msgspec.json.encode(version.write(message))
