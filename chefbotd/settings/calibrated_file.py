"""Calibrated values written into a robot's configuration: comments kept, the old file kept, the difference shown."""

import difflib
import math
import shutil
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tomlkit.exceptions import TOMLKitError

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.settings.errors import SettingsError
from chefbotd.settings.loader import load
from chefbotd.settings.model import Settings
from chefbotd.settings.replace_file import read_writable, replace_file
from chefbotd.settings.toml_edit import Editor

DIGITS = 6
"""Significant digits of a written value: a hundred times finer than any standard deviation of a calibration."""

Values = Mapping[str, float]
"""New values by the paths of their keys; an element of a list is named: ``lidar.front.mount_x_m``."""


class Saved(Record, frozen=True):
    """What was written: the file, where the old one is kept, and the lines that differ (a unified diff)."""

    path: str
    kept: str
    difference: str


def save(path: Path, values: Values) -> Saved:
    """Write the values into the configuration at ``path``, in one step or not at all. The old file is kept beside it.

    Raises:
        SettingsError: the file is no configuration, has no such list element, or would be none with the values.
        OSError: it cannot be read, kept or replaced.
    """
    path = path.resolve()
    load(path)
    before = read_writable(path)
    try:
        after = with_values(before, values)
    except (ValueError, TOMLKitError) as error:
        raise SettingsError(f"{path}: cannot be edited: {error}") from error
    kept = _next_free(path)
    shutil.copy2(path, kept)
    try:
        replace_file(path, after)
    except BaseException:
        kept.unlink()
        raise
    return Saved(str(path), str(kept), difference(path.name, before, after))


def with_values(text: str, values: Values) -> str:
    """The configuration with these values; everything else is unchanged.

    Raises:
        ValueError: a list has no element of that name, or the text has a form that cannot be edited.
    """
    editor = Editor(text)
    written = {key: _as_written(key, value) for key, value in values.items()}
    for key, value in written.items():
        *section, name = key.split(".")
        editor.change(tuple(section), {name: value})
    after = editor.text()
    said = tomllib.loads(after)
    wrong = [key for key, value in written.items() if _at(said, key) != value]
    if wrong:
        raise ValueError(
            f"{', '.join(wrong)}: the file has no such section, or in a form that is not supported"
        )
    return after


def difference(name: str, before: str, after: str) -> str:
    """The lines that differ, as a unified diff."""
    lines = difflib.unified_diff(
        before.splitlines(), after.splitlines(), f"{name} (before)", f"{name} (after)", n=1, lineterm=""
    )
    return "\n".join(lines)


def calibrated(settings: Settings, values: Values) -> Settings:
    """The settings with these values.

    Raises:
        SettingsError: a value is out of its range, or there is no such key.
    """
    plain = settings.model_dump(mode="python", by_alias=True)
    for key, value in values.items():
        *section, name = key.split(".")
        _section(plain, section)[name] = _as_written(key, value)
    try:
        return Settings.model_validate(plain)
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
    if isinstance(part, Parameters) and name in type(part).model_fields:
        return getattr(part, name)
    raise KeyError(name)


def _as_written(key: str, value: float) -> float | int:
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


def _at(said: Any, key: str) -> Any:
    """The value at this path of a parsed file; None where it has none."""
    for name in key.split("."):
        if isinstance(said, list):
            said = _named(said, name)
        elif isinstance(said, dict):
            said = said.get(name)
        else:
            return None
    return said


def _named(elements: list[Any], name: str) -> Any:
    """The element of this name. The only one of a list may have none."""
    named = [element for element in elements if element.get("name") == name]
    if not named and len(elements) == 1 and "name" not in elements[0]:
        named = elements
    return named[0] if len(named) == 1 else None


def _next_free(path: Path) -> Path:
    """A name beside the file that nothing has yet: ``robot.toml.before``, ``robot.toml.before-2``, ..."""
    for number in range(1, 10_000):
        kept = path.with_name(f"{path.name}.before{'' if number == 1 else f'-{number}'}")
        if not kept.exists():
            return kept
    raise FileExistsError(f"{path}.before-*: there are 10,000 old files already; remove some")
