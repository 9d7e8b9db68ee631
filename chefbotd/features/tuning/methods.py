"""Tuning: the methods that read and change the gains of the wheels' controllers."""

from collections.abc import Mapping
from typing import Annotated, Any, Protocol

from pydantic import Field, create_model, model_validator
from pydantic.fields import FieldInfo

from chefbotd.motion.pid import PidParameters
from chefbotd.rpc.method import Caller, method
from chefbotd.rpc.models import NoParams, Params, Result
from chefbotd.rpc.roles import Role


class Wheels(Result):
    """The gains by wheel name."""

    wheels: dict[str, PidParameters]


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


class Gains(Protocol):
    """What keeps the gains; a change that is not made raises ``chefbotd.core.commands.Refused``."""

    def gains(self) -> Mapping[str, PidParameters]:
        """The gains by wheel name."""
        ...

    def change(self, wheel: str, changes: Mapping[str, object]) -> Mapping[str, PidParameters]:
        """Change gains of one wheel or of ``"all"``: what every wheel now has."""
        ...

    def undo(self) -> Mapping[str, PidParameters]:
        """Take the latest change of gains back: what every wheel now has."""
        ...


class TuningMethods:
    """The methods of this feature."""

    def __init__(self, gains: Gains) -> None:
        self._gains = gains

    @method(role=Role.OBSERVE)
    def get_pid(self, caller: Caller, params: NoParams) -> Wheels:
        """The gains of every wheel."""
        return Wheels(wheels=dict(self._gains.gains()))

    @method(role=Role.ADMIN, moves=False, params=SetPidParams)
    def set_pid(self, caller: Caller, params: WheelParams) -> Wheels:
        """Change gains of one wheel or of all wheels at run time; returns the gains of every wheel."""
        return Wheels(wheels=dict(self._gains.change(params.wheel, params.changes())))

    @method(role=Role.ADMIN, moves=False)
    def undo_pid(self, caller: Caller, params: NoParams) -> Wheels:
        """Undo the latest change of gains, whoever made it; returns the gains of every wheel."""
        return Wheels(wheels=dict(self._gains.undo()))
