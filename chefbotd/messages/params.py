"""What each method takes, as strict pydantic models: a bool is no number, nor is a string."""

from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, SecretStr, create_model, model_validator
from pydantic.fields import FieldInfo

from chefbotd.motion.pid import PidParameters

ALL_WHEELS = "all"
MOST_WHEELS: Final = 64
FARTHEST_M: Final = 1e6  # a slip of the finger, beyond; within, a double tells 0.1 nm
WheelName = Annotated[str, Field(min_length=1, max_length=64)]

_SOURCE = Field(
    None, min_length=1, max_length=64, description="the robot's own default source, if none is named"
)


class Params(BaseModel):
    """Parameters by name; unknown names are refused. Values of ``confidential`` ones are never repeated in errors."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)
    confidential: ClassVar[bool] = False


class NoParams(Params):
    """Nothing."""


class AuthenticateParams(Params):
    """A token of the daemon's token file."""

    confidential: ClassVar[bool] = True

    token: SecretStr = Field(max_length=512)


class SetClientNameParams(Params):
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
