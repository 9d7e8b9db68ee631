"""What each method takes and gives back, as strict pydantic models: a bool is no number, nor is a string."""

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SecretStr,
    SerializeAsAny,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from chefbotd.api.roles import Role
from chefbotd.api.telemetry import LinkData, SafetyData, TopicData
from chefbotd.motion.pid import PidParameters

PROTOCOL: Final = "1.0"
ALL_WHEELS = "all"
MOST_WHEELS: Final = 64
FARTHEST_M: Final = 1e6  # a slip of the finger, beyond; within, a double tells 0.1 nm
WheelName = Annotated[str, Field(min_length=1, max_length=64)]

_SOURCE = Field(
    None, min_length=1, max_length=64, description="the robot's own default source, if none is named"
)


class Params(BaseModel):
    """Parameters by name; unknown names are refused. Values of ``confidential`` ones are never repeated in errors."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)
    confidential: ClassVar[bool] = False


class NoParams(Params):
    """Nothing."""


class AuthenticateParams(Params):
    """A token of the daemon's token file."""

    confidential: ClassVar[bool] = True

    token: SecretStr = Field(max_length=512)


class IntroduceParams(Params):
    """What the client wants to be called, in letters that can be printed."""

    client: str = Field(min_length=1, max_length=64, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")


class TakeControlParams(Params):
    """The source of commands to have for oneself."""

    source: str | None = _SOURCE


class DriveParams(Params):
    """A velocity in the robot's frame: forward in m/s, turning in rad/s (CCW positive)."""

    linear_m_s: float
    angular_rad_s: float
    source: str | None = _SOURCE


class SetWheelVelocitiesParams(Params):
    """Wheels by name, and how fast each of them is to turn (forward positive); the others stand."""

    name: list[WheelName] = Field(min_length=1, max_length=MOST_WHEELS)
    velocity_rad_s: list[float] = Field(min_length=1, max_length=MOST_WHEELS)
    source: str | None = _SOURCE

    @model_validator(mode="after")
    def _one_for_each(self) -> "SetWheelVelocitiesParams":
        if len(self.name) != len(self.velocity_rad_s):
            raise ValueError(f"{len(self.name)} names for {len(self.velocity_rad_s)} velocities")
        if repeated := sorted({name for name in self.name if self.name.count(name) > 1}):
            raise ValueError(f"each wheel once, repeated: {', '.join(map(ascii, repeated))}")
        return self

    def by_name(self) -> dict[str, float]:
        """The velocity of each wheel."""
        return dict(zip(self.name, self.velocity_rad_s, strict=True))


class ResetOdometryParams(Params):
    """Where the robot now stands in ``odom``."""

    x_m: float = Field(0.0, ge=-FARTHEST_M, le=FARTHEST_M)
    y_m: float = Field(0.0, ge=-FARTHEST_M, le=FARTHEST_M)
    heading_rad: float = Field(0.0, description="CCW positive; taken modulo a turn")


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


def _optional(field: FieldInfo) -> tuple[Any, Any]:
    """The gain's own type and range; its absence, not a value, means no change."""
    annotation = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
    return annotation, Field(None, description=field.description, json_schema_extra=_without_default)


def _without_default(schema: dict[str, Any]) -> None:
    schema.pop("default", None)


class WheelParams(Params):
    """A wheel, and something to change; ``SetPidParams`` adds the gains."""

    wheel: str = Field(min_length=1, max_length=64, description='a wheel\'s name, or "all"')

    @model_validator(mode="after")
    def _something_changes(self) -> "WheelParams":
        if self.model_fields_set <= {"wheel"}:
            raise ValueError("at least one gain must be given")
        return self

    def changes(self) -> dict[str, object]:
        """The gains that were named, and nothing else."""
        return self.model_dump(exclude_unset=True, exclude={"wheel"})


_GAINS: dict[str, Any] = {name: _optional(field) for name, field in PidParameters.model_fields.items()}

SetPidParams = create_model(
    "SetPidParams",
    __base__=WheelParams,
    __doc__="A wheel and the gains to change; gains not named stay as they are.",
    **_GAINS,
)


class Result(BaseModel):
    """What a method answers."""

    model_config = ConfigDict(frozen=True)


class Done(Result):
    """It was carried out."""

    ok: Literal[True] = True


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
    """The robot's links and joints as a URDF document; null where the configuration names none."""

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


def explain(problem: ValidationError, *, confidential: bool = False) -> tuple[str, list[dict[str, str]]]:
    """A message that names each field, its value (unless confidential) and what was expected, and the same as data."""
    errors = problem.errors(include_url=False, include_context=False)
    fields = [_field_problem(error, confidential=confidential) for error in errors]
    return "; ".join(_sentence(f) for f in fields), fields


def _field_problem(error: ErrorDetails, *, confidential: bool) -> dict[str, str]:
    value = "nothing" if error["type"] == "missing" else _shortened(repr(error["input"]))
    if confidential:
        return {"field": "params", "expected": error["msg"], "got": "what is not repeated here"}
    expected = "No such parameter" if error["type"] == "extra_forbidden" else error["msg"]
    return {"field": _path(error["loc"]), "expected": expected, "got": value}


def _sentence(problem: dict[str, str]) -> str:
    return f"{problem['field']}: {problem['expected']}, got {problem['got']}"


def _path(location: Sequence[int | str]) -> str:
    return ".".join(str(step) for step in location) or "params"


def _shortened(text: str, limit: int = 60) -> str:
    return text if len(text) <= limit else text[:limit] + "..."
