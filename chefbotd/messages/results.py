"""What each method gives back, and what else the daemon sends, as pydantic models."""

from typing import Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, SerializeAsAny

from chefbotd.messages.roles import Role
from chefbotd.messages.telemetry import LinkData, SafetyData, TopicData
from chefbotd.motion.pid import PidParameters

PROTOCOL: Final = "1.0"


class Result(BaseModel):
    """What a method answers."""

    model_config = ConfigDict(frozen=True, defer_build=True)


class Done(Result):
    """It was carried out."""

    ok: Literal[True] = True


class Stopped(Done):
    """Who was driving: the client's name by its source, the one that stopped the robot among them."""

    drivers: dict[str, str]


class Limited(Done):
    """It is carried out as far as the configured limits allow; ``limited_by`` is the key of the tightest."""

    limited_by: str | None = Field(
        None,
        description="null where it is carried out as it was asked; what holds it up now is told by safety",
    )


class Driven(Limited):
    """The velocity that the robot goes for."""

    linear_m_s: float
    angular_rad_s: float


class WheelsDriven(Limited):
    """The velocities that the named wheels go for, in the order in which they were named."""

    name: list[str]
    velocity_rad_s: list[float]


class Known(Result):
    """Who this client is to the daemon, and what it may do."""

    client: str
    role: Role


class Taken(Result):
    """The source is this client's; ``taken_from`` names who had it, null where nobody else did."""

    source: str
    taken_from: str | None


class Released(Result):
    """The sources that this client had until now."""

    sources: list[str]


class RobotDescription(Result):
    """The robot's links and joints as a URDF document; null where one of its own cannot be read."""

    urdf: str | None


class Pong(Result):
    """The daemon lives; ``stamp_s`` is its monotonic time."""

    pong: Literal[True] = True
    stamp_s: float


class Subscribed(Result):
    """All the topics that this client now receives."""

    topics: list[str]


class Wheels(Result):
    """The gains by wheel name."""

    wheels: dict[str, PidParameters]


class TopicState(Result):
    """A topic's latest value and how old it is; ``seq`` counts its events, sent to this client or not."""

    seq: int
    stamp_s: float
    age_s: float
    data: SerializeAsAny[TopicData]


class State(Result):
    """The link, the gate, and the latest value of each topic that has had one."""

    stamp_s: float
    link: LinkData
    safety: SafetyData
    topics: dict[str, TopicState]


class Hello(Result):
    """The greeting; ``session`` changes when the daemon restarts, ``auth`` is what a client must do first."""

    protocol: Literal["1.0"] = PROTOCOL
    robot: str
    session: str
    link: Literal["up", "down"]
    auth: Literal["none", "token"]
    capabilities: tuple[str, ...]


class Event(TopicState):
    """One telemetry object."""

    topic: str


class Dropped(Result):
    """How many events a client that reads too slowly has lost since the last such notice."""

    topics: dict[str, int]
    total: int


class MethodDescription(Result):
    """A method's purpose, the role that it needs (null: none), and the JSON Schemas of what it takes and gives."""

    summary: str
    role: Role | None
    params: dict[str, Any]
    result: dict[str, Any]


class TopicDescription(Result):
    """A topic's purpose and the JSON Schema of its data."""

    summary: str
    data: dict[str, Any]


class ErrorDescription(Result):
    """A kind of error: its JSON-RPC code, its meaning, and whether it ends the connection."""

    code: int
    meaning: str
    closes: bool


class Description(Result):
    """The whole interface, made from the models that check it."""

    protocol: str
    methods: dict[str, MethodDescription]
    topics: dict[str, TopicDescription]
    notifications: dict[str, dict[str, Any]]
    errors: dict[str, ErrorDescription]
