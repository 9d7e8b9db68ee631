"""A valid value of any model of the socket, made from what the model says of its members."""

from contextlib import suppress
from enum import Enum
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le
from msgspec import structs
from pydantic import BaseModel, SecretStr, ValidationError
from pydantic.fields import FieldInfo

from chefbotd.core.record import Record
from chefbotd.rpc.encoding import UnknownData

M = TypeVar("M")

PLAIN: dict[Any, Any] = {bool: True, int: 1, float: 1.0, SecretStr: SecretStr("0123456789abcdef")}


def example(model: type[M]) -> M:
    """What is required; where that is not valid, one optional member with it, or all of them.

    Raises:
        TypeError: none of these is valid; ``Field(examples=[...])`` says what is.
    """
    if issubclass(model, UnknownData):
        return model()
    if issubclass(model, Record):
        needed = [field for field in structs.fields(model) if field.required]
        return model(**{field.name: _value(field.name, field.type) for field in needed})
    assert issubclass(model, BaseModel)
    values = {name: _member(name, field) for name, field in model.model_fields.items()}
    required = {name: values[name] for name, field in model.model_fields.items() if field.is_required()}
    for chosen in (required, *({**required, name: values[name]} for name in values), values):
        with suppress(ValidationError):
            return model.model_validate(chosen)
    raise TypeError(f"{model.__name__}: expected Field(examples=[...]) of its members, {values} is not valid")


def _member(name: str, field: FieldInfo) -> Any:
    if field.examples:
        return field.examples[0]
    value = _value(name, field.annotation)
    for bound in field.metadata:
        if isinstance(bound, Ge):
            value = max(value, bound.ge)
        elif isinstance(bound, Gt) and value <= bound.gt:
            value = bound.gt + 1
        elif isinstance(bound, Le):
            value = min(value, bound.le)
    return value


def _value(name: str, kind: Any) -> Any:
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _value(name, parts[0])
    if origin in (Union, UnionType):
        return _value(name, next(part for part in parts if part is not NoneType))
    if origin is Literal:
        return parts[0]
    if origin is not None:
        return [_value(name, parts[0])] if origin is list else origin()
    if isinstance(kind, type) and issubclass(kind, BaseModel | Record):
        return example(kind)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return next(iter(kind))
    return PLAIN.get(kind, name)
