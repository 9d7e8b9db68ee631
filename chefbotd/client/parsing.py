"""Parses JSON values into the documented models."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from chefbotd.client.errors import ProtocolError

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

M = TypeVar("M", bound="BaseModel")


def parse(model: type[M], value: object) -> M:
    """The value as a model. Members that a newer daemon has added are passed over; null for a number is nan.

    JSON has no number that is not finite: the daemon sends null in its place.

    Raises:
        ProtocolError: something is missing, or of another type.
    """
    from pydantic import ValidationError

    try:
        return model.model_validate(value)
    except ValidationError as problem:
        mended = _with_nan(value, problem)
    try:
        return model.model_validate(mended)
    except ValidationError as problem:
        first = problem.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "the whole"
        told = f"{model.__name__}: {where}: {first['msg']}, got {first['input']!r:.60}"
        raise ProtocolError(f"the daemon sent what this client does not understand: {told}") from problem


def _with_nan(value: object, problem: ValidationError) -> object:
    """A copy with nan where a number was expected and null came."""
    places = [e["loc"] for e in problem.errors() if e["type"] == "float_type" and e["input"] is None]
    for place in places:
        value = _replaced(value, place)
    return value


def _replaced(value: Any, place: tuple[int | str, ...]) -> Any:
    if not place:
        return math.nan
    step, rest = place[0], place[1:]
    if isinstance(value, Mapping) and step in value:
        return {**value, step: _replaced(value[step], rest)}
    if isinstance(value, list) and isinstance(step, int) and step < len(value):
        return [*value[:step], _replaced(value[step], rest), *value[step + 1 :]]
    return value
