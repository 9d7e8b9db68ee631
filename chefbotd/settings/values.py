"""Single values of a configuration by the paths of their keys, as calibration finds them."""

import math
from collections.abc import Mapping
from typing import Any, TypeAlias

from chefbotd.core.parameters import Parameters
from chefbotd.settings.errors import SettingsError
from chefbotd.settings.model import Settings

DIGITS = 6
"""Significant digits of a written value: a hundred times finer than any standard deviation of a calibration."""

Values: TypeAlias = Mapping[str, float]
"""New values by the paths of their keys; an element of a list is named: ``lidar.front.mount_x_m``."""


def apply_calibration(settings: Settings, values: Values) -> Settings:
    """The settings with these values.

    Raises:
        SettingsError: a value is out of its range, or there is no such key.
    """
    plain = settings.model_dump(mode="python", by_alias=True)
    for key, value in values.items():
        *section, name = key.split(".")
        _section(plain, section)[name] = as_written(key, value)
    try:
        return type(settings).model_validate(plain)
    except ValueError as error:
        raise SettingsError(f"the calibrated values do not fit the configuration: {error}") from error


def value_of(settings: Settings, key: str) -> float | None:
    """The value of a key in force; None where it is not set.

    Raises:
        KeyError: the configuration has no such key.
    """
    part: Any = settings
    for name in key.split("."):
        part = _inner(part, name)
    return None if part is None else float(part)


def _inner(part: Any, name: str) -> Any:
    if part is None:
        return None
    if isinstance(part, tuple):
        named = [element for element in part if element.name == name]
        if not named:
            raise KeyError(name)
        return named[0]
    if isinstance(part, Mapping):
        return part.get(name)
    if isinstance(part, Parameters):
        for field, info in type(part).model_fields.items():
            if name == (info.alias or field):
                return getattr(part, field)
    raise KeyError(name)


def as_written(key: str, value: float) -> float | int:
    """The value as a file has it: rounded, and a sign as a whole number. Raises ``ValueError``: it is not finite."""
    if not math.isfinite(value):
        raise ValueError(f"{key}: {value} is no finite number")
    if key.endswith("_sign"):
        return round(value)
    return float(f"{value:.{DIGITS}g}")


def _section(plain: Any, path: list[str]) -> Any:
    """The part of the plain settings at this path; a missing section is made."""
    for name in path:
        if isinstance(plain, list | tuple):
            plain = next((element for element in plain if element.get("name") == name), None)
            if plain is None:
                raise SettingsError(f"the configuration has no {'.'.join(path)}")
        elif plain.get(name) is None:
            plain[name] = {}
            plain = plain[name]
        else:
            plain = plain[name]
    return plain
