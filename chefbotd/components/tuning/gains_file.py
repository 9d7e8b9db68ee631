"""Gains written into a robot's configuration file: its comments and order kept, and never half a file.

``[pid]`` has the gains of all wheels but those that have a ``[wheel_pid.NAME]`` of their own.
"""

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from tomlkit.exceptions import TOMLKitError

from chefbotd.motion.pid import PidParameters
from chefbotd.settings.base import base_of, merge
from chefbotd.settings.errors import SettingsError
from chefbotd.settings.loader import load, read_values
from chefbotd.settings.replace_file import read_writable, replace_file
from chefbotd.settings.toml_edit import Editor

Gains = Mapping[str, PidParameters]


def save(path: Path, gains: Gains) -> None:
    """Write every wheel's gains (by its name) into the configuration at ``path``, in one step or not at all.

    The new file is loaded as a configuration first, and differs from the old one in the gains only. It keeps the owner
    and the mode. Gains that the environment sets are not written; the environment continues to set them.

    Raises:
        SettingsError: the file is no configuration, or is that of a robot with other wheels.
        OSError: it cannot be read or replaced.
    """
    path = path.resolve()  # a symbolic link goes on pointing at it
    wheels = load(path).gains().keys()
    if wheels != gains.keys():
        theirs, ours = ", ".join(sorted(gains)), ", ".join(sorted(wheels))
        raise SettingsError(f"{path}: is for the wheels {ours}; the gains are for {theirs}")
    before = read_writable(path)
    after = _edit_gains(path, before, {wheel: gains[wheel] for wheel in wheels})
    if after != before:
        replace_file(path, after)


def with_gains(text: str, gains: Gains) -> str:
    """The configuration with these gains, in the order of the wheels; everything else is unchanged.

    ``[pid]`` stays as it is if any wheel has its gains, or if every wheel has its own section. Otherwise it gets the
    gains of most wheels; on a tie, of the first. A wheel's section is removed when the wheel's gains become those of
    ``[pid]``. A section that was equal before is deliberate, and stays.
    """
    said = _values_of(text)
    sections: dict[str, Any] = said.get("wheel_pid", {})
    usual, own = _read(said.get("pid")), {wheel: _read(section) for wheel, section in sections.items()}
    common = usual if usual and _is_usual(usual, own, gains) else _most_common(gains)
    meant = {wheel for wheel in own if own[wheel] == usual}
    apart = {wheel: those for wheel, those in gains.items() if those != common or wheel in meant}

    editor = Editor(text)
    editor.change(("pid",), _changes(said.get("pid", {}), common))
    for wheel in own.keys() - apart.keys():
        editor.drop(("wheel_pid", wheel))
    for wheel, those in apart.items():
        editor.change(("wheel_pid", wheel), _changes(sections.get(wheel, {}), those))
    return editor.text()


def _values_of(text: str) -> dict[str, Any]:
    """The values of a file's text, with those of the packaged robot that it extends."""
    own = tomllib.loads(text)
    base = base_of(own)
    return own if base is None else merge(read_values(base), own)


def _read(section: object) -> PidParameters | None:
    """A section's gains; None if the section is missing, or incomplete because the environment adds to it."""
    try:
        return PidParameters.model_validate(section, strict=True)
    except ValidationError:
        return None


def _is_usual(usual: PidParameters, own: Mapping[str, object], gains: Gains) -> bool:
    return usual in gains.values() or own.keys() >= gains.keys()


def _most_common(gains: Gains) -> PidParameters:
    values = list(gains.values())
    return max(values, key=values.count)


def _changes(said: Mapping[str, object], gains: PidParameters) -> dict[str, object]:
    """The changes of a section by key. A default is not added; None removes a key."""
    changes = {}
    for name, field in PidParameters.model_fields.items():
        key = name if name in said else field.alias or name
        if said.get(key, field.default) != (value := getattr(gains, name)):
            changes[key] = value
    return changes


def _edit_gains(path: Path, before: str, gains: Gains) -> str:
    """Check the text by reading it back, because some forms of TOML may not be edited correctly."""
    try:
        after = with_gains(before, gains)
        is_right = _tell_apart(after, gains) == (gains, _tell_apart(before, gains)[1])
    except (ValueError, TOMLKitError) as error:
        raise SettingsError(f"{path}: cannot be edited: {error}") from error
    if not is_right:
        raise SettingsError(
            f"{path}: cannot be edited: its gains are written in a form that is not supported"
        )
    return after


def _tell_apart(text: str, wheels: Iterable[str]) -> tuple[dict[str, PidParameters | None], dict[str, Any]]:
    """The gains of these wheels in a file, and everything else in it."""
    said = _values_of(text)
    own, usual = said.pop("wheel_pid", {}), said.pop("pid", None)
    return {wheel: _read(own.get(wheel, usual)) for wheel in wheels}, said
