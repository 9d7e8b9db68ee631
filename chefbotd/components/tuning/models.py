"""Tuning: the gains of the wheels' controllers, and the changes that are asked for."""

from typing import Annotated, Any

from pydantic import Field, create_model, model_validator
from pydantic.fields import FieldInfo

from chefbotd.core.record import Record
from chefbotd.motion.pid import PidParameters
from chefbotd.rpc.models import Params


class Wheels(Record, frozen=True):
    """The gains by wheel name."""

    wheels: dict[str, PidParameters]


def _optional(field: FieldInfo) -> tuple[Any, Any]:
    """The gain's type and range; a missing key, not a value, means no change."""
    annotation = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
    return annotation, Field(None, description=field.description, json_schema_extra=_without_default)


def _without_default(schema: dict[str, Any]) -> None:
    schema.pop("default", None)


class WheelParams(Params):
    """A wheel and its changes; ``SetPidParams`` adds the gains."""

    wheel: str = Field(min_length=1, max_length=64, description='a wheel\'s name, or "all"')

    @model_validator(mode="after")
    def _something_changes(self) -> "WheelParams":
        if self.model_fields_set <= {"wheel"}:
            raise ValueError("at least one gain must be given")
        return self

    def changes(self) -> dict[str, object]:
        """Only the gains that the request named."""
        return self.model_dump(exclude_unset=True, exclude={"wheel"})


_GAINS: dict[str, Any] = {name: _optional(field) for name, field in PidParameters.model_fields.items()}

SetPidParams = create_model(
    "SetPidParams",
    __base__=WheelParams,
    __doc__="A wheel and the gains to change; gains not named stay as they are.",
    **_GAINS,
)
