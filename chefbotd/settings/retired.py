"""Keys of earlier versions that are constants now: each section names its own in ``retired``, with their values.

A recording cannot be edited: its configuration may hold such a key, with the constant's value. A file may not.
"""

from collections.abc import Iterator, Mapping
from typing import Any, get_args, get_origin

from pydantic import BaseModel

from chefbotd.core.parameters import Parameters


class RetiredKey(Exception):
    """A recorded key had another value than the constant that took its place."""


def drop_retired(model: type[BaseModel], values: Mapping[str, Any], path: str = "") -> None:
    """Remove retired keys from a recorded configuration.

    Raises:
        RetiredKey: the value of one is not the constant.
    """
    for section, inner, place in _sections(model, values, path):
        for key, constant in section.retired.items():
            if key in inner:
                _require_equal(inner.pop(key), constant, f"{place}{key}")


def advice_of(section: type[BaseModel] | None, key: str) -> str:
    """What to do about an unknown key that is retired; empty if it is not."""
    if section is None or not issubclass(section, Parameters) or key not in section.retired:
        return ""
    constant = section.retired[key]
    value = "its values are fixed" if isinstance(constant, Mapping) else f"it is always {constant}"
    return f", which earlier versions had: now {value}; remove it"


def _sections(
    model: type[BaseModel], values: Any, path: str
) -> Iterator[tuple[type[Parameters], dict[str, Any], str]]:
    """The tables with their models, from the innermost out."""
    if not isinstance(values, dict):
        return
    for name, field in model.model_fields.items():
        key = field.alias or name
        for inner in models_in(field.annotation):
            for place, table in tables_in(values.get(key), field.annotation, f"{path}{key}."):
                yield from _sections(inner, table, place)
    if issubclass(model, Parameters):
        yield model, values, path


def tables_in(value: Any, annotation: Any, path: str) -> Iterator[tuple[str, Any]]:
    """One table, those in a list, or those by name."""
    kinds = [get_origin(kind) for kind in (annotation, *get_args(annotation))]
    if isinstance(value, list):
        yield from ((f"{path}{number}.", table) for number, table in enumerate(value))
    elif isinstance(value, dict) and any(kind in (dict, Mapping) for kind in kinds):
        yield from ((f"{path}{name}.", table) for name, table in value.items())
    else:
        yield path, value


def models_in(annotation: object) -> Iterator[type[BaseModel]]:
    """The models of tables that may stand there."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from models_in(argument)


def _require_equal(value: object, constant: object, path: str) -> None:
    if isinstance(value, Mapping) and isinstance(constant, Mapping):
        for key, inner in value.items():
            _require_equal(inner, constant.get(key), f"{path}.{key}")
    elif value != constant:
        now = "no such key" if constant is None else f"always {constant}"
        raise RetiredKey(f"{path} was {value} then, and this version has {now}")
