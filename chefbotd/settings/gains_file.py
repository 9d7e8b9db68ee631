"""Gains written into a robot's configuration file: its comments and order kept, and never half a file.

``[pid]`` has the gains of all wheels but those that have a ``[wheel_pid.NAME]`` of their own.
"""

import os
import stat
import tempfile
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import IO, Any

from pydantic import ValidationError
from tomlkit.exceptions import TOMLKitError

from chefbotd.motion.pid import PidParameters
from chefbotd.settings.errors import SettingsError
from chefbotd.settings.loader import load
from chefbotd.settings.toml_edit import Editor
from chefbotd.storage import sync_folder

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
    with path.open("r+b") as file:  # as a file that may not be written to must not be replaced either
        before = file.read().decode("utf-8-sig")
    after = _edited(path, before, {wheel: gains[wheel] for wheel in wheels})
    if after != before:
        _replace(path, after)


def with_gains(text: str, gains: Gains) -> str:
    """The configuration with these gains, in the order of the wheels; everything else is unchanged.

    ``[pid]`` stays as it is if any wheel has its gains, or if every wheel has its own section. Otherwise it gets the
    gains of most wheels; on a tie, of the first. A wheel's section is removed when the wheel's gains become those of
    ``[pid]``. A section that was equal before is deliberate, and stays.
    """
    said = tomllib.loads(text)
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


def _edited(path: Path, before: str, gains: Gains) -> str:
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
    said = tomllib.loads(text)
    own, usual = said.pop("wheel_pid", {}), said.pop("pid", None)
    return {wheel: _read(own.get(wheel, usual)) for wheel in wheels}, said


def _replace(path: Path, text: str) -> None:
    with _temporary(path) as fresh:
        temporary = Path(fresh.name)
        try:
            _fill(fresh, text, path.stat())
            _load_as(path, temporary)
            temporary.replace(path)
        except BaseException:
            temporary.unlink()
            raise
    sync_folder(path.parent)  # without this a power cut might bring the old file back


def _temporary(path: Path) -> IO[bytes]:
    """A new file beside the old one, because replacing is atomic only within a folder."""
    try:
        return tempfile.NamedTemporaryFile(
            "wb", dir=path.parent, prefix=f".{path.stem}.", suffix=".toml", delete=False
        )
    except OSError as error:
        raise OSError(
            error.errno, f"cannot create a file in its folder: {error.strerror}", str(path)
        ) from error


def _load_as(path: Path, temporary: Path) -> None:
    """Load the new content of ``path``, and name ``path`` if it is refused."""
    try:
        load(temporary)
    except SettingsError as error:
        raise SettingsError(str(error).replace(str(temporary), str(path))) from error


def _fill(fresh: IO[bytes], text: str, like: os.stat_result) -> None:
    """Write the file and flush it to the disk, with owner and mode of the file that it replaces."""
    fresh.write(text.encode())
    fresh.flush()
    os.fchown(fresh.fileno(), like.st_uid, like.st_gid)
    os.fchmod(fresh.fileno(), stat.S_IMODE(like.st_mode))
    os.fsync(fresh.fileno())
