"""Loads a robot's TOML file with overrides from the environment as validated, frozen parameters.

A key is a field of the parameter class that lives beside its algorithm; what is unknown or out of range is refused with
the key, the value and what was expected. ``CHEFBOTD_LINK__DEVICE=/dev/ttyUSB0`` overrides ``[link] device``, and
``CHEFBOTD_CHASSIS__WHEELS__LEFT_WHEEL__RADIUS_M=0.05`` the radius of the left wheel, by its name or by its number (0).
A file may say only what differs from a packaged robot (``chefbotd.settings.base``).
"""

import json
import os
import re
import stat
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from chefbotd.component_list import own_components
from chefbotd.extras import how_to_add_extra
from chefbotd.settings.base import base_of, drop_left_out, merge, packaged
from chefbotd.settings.checks import check
from chefbotd.settings.errors import (
    Keys,
    MissingExtraError,
    SettingsError,
    UnknownKey,
    blame_source,
    explain,
    from_environment,
    place,
    read,
    variable,
)
from chefbotd.settings.model import Settings
from chefbotd.settings.sections import model_for, paths_of

KEY = r"'([^']*)'"
TWICE = re.compile(r"Cannot declare \((.*)\) twice")
"""What tomllib says of a table, with its name as a tuple of Python's."""

MAX_BYTES = 1 << 20
"""The longest configuration that is read: a hundred times the longest one of chefbotd."""

URDF_PACKAGES = ("urdf_parser_py", "lxml")
NO_URDF_PARSER = (
    f"urdf-parser-py, which reads it, is not installed: {how_to_add_extra('urdf')} "
    "(without the key, the URDF is made from the configuration, and needs nothing)"
)


def load(path: Path | None = None, *, overrides: Mapping[str, object] | None = None) -> Settings:
    """Read a configuration (None: the packaged ChefBot's), and a description of one's own with it.

    The environment overrides the file. ``overrides``, with dotted keys (``link.device``), override both. The result is
    valid for every program that drives a real robot.

    Raises:
        SettingsError: the file cannot be read or parsed, a value is refused, or the description is another robot's.
        MissingExtraError: there is a description of one's own, and its parser is not installed.
    """
    path = path or packaged()
    values = read_values(path)
    _name_tables(values)
    texts, origins = _place_overrides(values, overrides or {})
    _name_tables(values)
    drop_left_out(values)
    _locate(values, path.parent, "robot", "description")
    model = model_for(values, Settings)
    for section, key in paths_of(model):
        _locate(values, path.parent, section, key)
    try:
        settings = _validate(model, values, texts)
    except ValidationError as error:
        raise SettingsError(explain(error, model, values, origins, f"{path}: ")) from error
    if wrong := "; ".join(check(settings)):
        raise SettingsError(f"{blame_source(wrong, origins, path)}{wrong}")
    _check_description(settings)
    return settings


def _place_overrides(
    values: dict[str, Any], overrides: Mapping[str, object]
) -> tuple[dict[Keys, str], dict[Keys, str]]:
    """Put overrides into the file's values; returns the environment's texts by key, and the source of each key."""
    dotted_keys = {tuple(key.split(".")): value for key, value in overrides.items()}
    environment = {
        keys: text for keys, text in from_environment(os.environ).items() if keys not in dotted_keys
    }
    texts: dict[Keys, str] = {}
    origins: dict[Keys, str] = {}
    try:
        for keys, text in environment.items():
            origins[keys] = f"{variable(keys)}: "
            placed = place(values, keys, read(text))
            texts[placed], origins[placed] = text, origins[keys]
        for keys, value in dotted_keys.items():
            origins[keys] = ""
            origins[place(values, keys, value)] = ""
    except UnknownKey as error:
        raise SettingsError(f"{origins[keys]}{error}") from error
    return texts, origins


def read_values(path: Path) -> dict[str, Any]:
    """The values of a file; where it extends a packaged robot, with those of that robot.

    Raises:
        SettingsError: it cannot be read or parsed, or extends what is not there.
    """
    own = _from_file(path)
    try:
        base = base_of(own)
        return own if base is None else merge(read_values(base), own)
    except SettingsError as error:
        raise SettingsError(f"{path}: {error}") from error


def _from_file(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(_content(path).decode("utf-8-sig"))  # some editors begin a file with a mark
    except IsADirectoryError as error:
        raise SettingsError(f"{path}: is a folder, expected a TOML file") from error
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"{path}: not valid TOML: {TWICE.sub(_said_twice, str(error))}") from error
    except RecursionError as error:
        raise SettingsError(f"{path}: not valid TOML: lists or tables are nested too deep") from error


def _said_twice(match: re.Match[str]) -> str:
    """A table that was pasted below another of its name, as it stands in the file."""
    return f"[{'.'.join(re.findall(KEY, match[1]))}] stands twice: put all its keys under one of them"


def _content(path: Path) -> bytes:
    """The bytes of a regular file that is not too long. Reading a FIFO could wait for ever (open(2))."""
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise SettingsError(
                f"{path}: is no regular file (a pipe, a socket or a device), expected a TOML file"
            )
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise SettingsError(f"{path}: is larger than {MAX_BYTES // 1024} KiB, expected a TOML file")
    return content


def _name_tables(values: dict[str, Any]) -> None:
    """A key of a component that may be a text alone becomes the table that it stands for."""
    for component in own_components():
        section = values.get(component.key)
        for key, meant in component.short_forms.items():
            if isinstance(section, dict) and isinstance(named := section.get(key), str):
                section[key] = {meant: named}


def _validate(model: type[Settings], values: dict[str, Any], texts: Mapping[Keys, str]) -> Settings:
    """Validate strictly: a number in quotes is refused, an integer is accepted as a float, a list as a tuple.

    A variable that reads as a number where text belongs, such as a robot called 7, is taken as text.
    """
    try:
        return model.model_validate_json(json.dumps(values, default=_as_json), strict=True)
    except ValidationError as error:
        text_keys = {
            tuple(map(str, p["loc"])) for p in error.errors() if p["type"] in ("string_type", "path_type")
        }
        mistaken = [keys for keys in texts if keys in text_keys and not isinstance(read(texts[keys]), str)]
        if not mistaken:
            raise
    for keys in mistaken:
        place(values, keys, texts[keys])
    return _validate(model, values, {})


def _as_json(value: object) -> object:
    """Turn TOML's dates into a value that every key refuses; some keys would accept them as text."""
    return str(value) if isinstance(value, Path) else {"date": str(value)}


def _locate(values: dict[str, Any], folder: Path, section: str, key: str) -> None:
    """Relative paths begin at the configuration's folder."""
    inner = values.get(section)
    if isinstance(inner, dict) and isinstance(named := inner.get(key), str):
        inner[key] = str(folder / named)


def _check_description(settings: Settings) -> None:
    """Compare the user's description with the configuration; a generated one needs no check."""
    path = settings.robot.description
    if path is None:
        return
    try:
        from chefbotd.settings.description import (  # slow to import, and rarely needed
            DescriptionError,
            UrdfDescription,
            differences,
        )
    except ModuleNotFoundError as error:
        if str(error.name).partition(".")[0] not in URDF_PACKAGES:
            raise
        raise MissingExtraError(f"robot.description: {path}: {NO_URDF_PARSER}") from error
    try:
        problems = differences(UrdfDescription(path), settings)
    except DescriptionError as error:
        raise SettingsError(f"robot.description: {error}") from error
    if problems:
        headline = f"robot.description: {path} does not describe the robot that is configured:"
        raise SettingsError("\n".join([headline, *problems]), problems)
