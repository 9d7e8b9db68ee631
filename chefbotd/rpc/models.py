"""The base class of parameters, which pydantic checks, and the server's own messages.

What is sent is a ``Record``: SI units, REP-103 axes, null for a number that is not finite.
"""

from enum import StrEnum
from typing import Annotated, Any, ClassVar, Final, Literal

from msgspec import Meta
from pydantic import BaseModel, ConfigDict, Field, SecretStr

from chefbotd.core.record import Record
from chefbotd.rpc.parameters import Role

PROTOCOL: Final = "1.0"
SOURCE: Final[Any] = Field(
    None, min_length=1, max_length=64, description="the robot's own default source, if none is named"
)


class Params(BaseModel):
    """Parameters by name, strict: a bool is no number, nor is a string. Unknown names are refused.

    Values of ``confidential`` ones are never repeated in errors.
    """

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)
    confidential: ClassVar[bool] = False


class MotionParams(Params):
    """What a request that may move the robot takes for granted: that nothing has stopped the robot since."""

    if_stop_number: int | None = Field(
        None,
        ge=0,
        description="the stop_number from the topic safety when this was decided; refused after any later stop or fault",
    )


class NoParams(Params):
    """Nothing."""


class Done(Record, frozen=True):
    """It was carried out."""

    ok: Annotated[bool, Meta(extra_json_schema={"const": True})] = True


DONE: Final = Done()


# The parameters of the server's own methods


class AuthenticateParams(Params):
    """A token of the daemon's token file."""

    confidential: ClassVar[bool] = True

    token: SecretStr = Field(max_length=512)


class SetClientNameParams(Params):
    """What the client wants to be called, in letters that can be printed."""

    client: str = Field(min_length=1, max_length=64, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")


class TakeControlParams(Params):
    """The source of commands to have for oneself."""

    source: str | None = SOURCE


class SubscribeParams(Params):
    """Topics, the most events a second of each, and what a client in arrears is spared.

    ``latest``: older values of a topic give way to newer ones. ``ordered``: every event, in order, until
    the outbox is full; then the oldest are dropped.
    """

    topics: list[str] = Field(min_length=1, max_length=64)
    max_rate_hz: float | None = Field(None, gt=0.0, le=1000.0)
    policy: Literal["latest", "ordered"] = "latest"


class UnsubscribeParams(Params):
    """Topics to end; without any, all of them."""

    topics: list[str] | None = Field(None, min_length=1, max_length=64)


# Their results, and the notifications


class Authenticated(Record, frozen=True):
    """Who this client is to the daemon, and what it may do."""

    client: str
    role: Role


class ControlTaken(Record, frozen=True):
    """The client now has control of the source; ``taken_from`` names the client that had it, or is null."""

    source: str
    taken_from: str | None


class Released(Record, frozen=True):
    """The sources that this client had until now."""

    sources: list[str]


class Pong(Record, frozen=True, kw_only=True):
    """The daemon lives; ``stamp_s`` is its monotonic time."""

    pong: Annotated[bool, Meta(extra_json_schema={"const": True})] = True
    stamp_s: float


class Subscribed(Record, frozen=True):
    """All the topics that this client now receives."""

    topics: list[str]


class PluginState(StrEnum):
    """What became of a plug-in that the configuration allows."""

    RUNNING = "running"
    NOT_FOUND = "not_found"
    INCOMPATIBLE = "incompatible"
    FAILED = "failed"


class PluginDescription(Record, frozen=True):
    """A plug-in that the configuration allows; ``reason`` says why it does not run (empty: it does)."""

    name: str
    package: str
    version: str
    state: PluginState
    reason: str = ""


class PluginList(Record, frozen=True):
    """The plug-ins that the configuration allows, in its order."""

    plugins: tuple[PluginDescription, ...]


class TopicState(Record, frozen=True):
    """A topic's latest value and how old it is; ``seq`` counts its events, sent to this client or not."""

    seq: int
    stamp_s: float
    age_s: float
    data: Annotated[Any, Meta(description="the topic's record", extra_json_schema={"type": "object"})]


class Greeting(Record, frozen=True, kw_only=True):
    """The greeting; ``session`` changes when the daemon restarts, ``auth`` is what a client must do first.

    A command to move is obeyed for ``command_timeout_s``.
    """

    protocol: Literal["1.0"] = PROTOCOL
    robot: str
    session: str
    link: Literal["up", "down"]
    auth: Literal["none", "token"]
    capabilities: tuple[str, ...]
    command_timeout_s: float


class TelemetryEvent(TopicState, frozen=True):
    """One telemetry object."""

    topic: str


class Dropped(Record, frozen=True):
    """How many events a client that reads too slowly has lost since the last such notice."""

    topics: dict[str, int]
    total: int


class MethodDescription(Record, frozen=True):
    """A method's purpose, the role that it needs (null: none), and the JSON Schemas of what it takes and gives.

    ``for_guests``: guests may call it, too; of other roles each may call what those below it may.
    """

    summary: str
    role: Role | None
    for_guests: bool
    params: dict[str, Any]
    result: dict[str, Any]


class TopicDescription(Record, frozen=True):
    """A topic's purpose, the JSON Schema of its data, and whether guests may subscribe to it."""

    summary: str
    for_guests: bool
    data: dict[str, Any]


class ErrorDescription(Record, frozen=True):
    """A kind of error: its JSON-RPC code, its meaning, and whether it ends the connection."""

    code: int
    meaning: str
    closes: bool


class Description(Record, frozen=True):
    """The whole interface, made from the models that check it."""

    protocol: str
    methods: dict[str, MethodDescription]
    topics: dict[str, TopicDescription]
    notifications: dict[str, dict[str, Any]]
    errors: dict[str, ErrorDescription]
    plugins: tuple[PluginDescription, ...] = ()
