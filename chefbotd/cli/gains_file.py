"""Gains written into a robot's configuration file: its comments and order kept, and never half a file.

The gains that most wheels have go to ``[pid]``; a wheel that differs gets a ``[wheel_pid.NAME]`` of its own.
"""

import os
import stat
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO

import tomlkit
from tomlkit.items import Table

from chefbotd.motion.pid import PidParameters
from chefbotd.settings import SettingsError, load

Gains = Mapping[str, PidParameters]


def save(path: Path, gains: Gains) -> None:
    """Write every wheel's gains (by its name) into the configuration at ``path``, in one step or not at all.

    What replaces the file was loaded as a configuration before; owner and mode are the old file's.

    Raises:
        SettingsError: the file is no configuration, or is that of a robot with other wheels.
        OSError: it cannot be read or replaced.
    """
    path = path.resolve()  # a symbolic link goes on pointing at it
    wheels = load(path).gains().keys()
    if wheels != gains.keys():
        theirs, ours = ", ".join(sorted(gains)), ", ".join(sorted(wheels))
        raise SettingsError(f"{path}: is for the wheels {ours}; the gains are for {theirs}")
    _replace(path, with_gains(path.read_bytes().decode(), gains))


def with_gains(text: str, gains: Gains) -> str:
    """The configuration with these gains; whatever says no gain that changed is as it was."""
    document = tomlkit.parse(text)
    values = list(gains.values())
    common = max(values, key=values.count)
    _put(document["pid"], common)
    _put_own(document, {wheel: own for wheel, own in gains.items() if own != common})
    return tomlkit.dumps(document)


def _put_own(document: tomlkit.TOMLDocument, own: Gains) -> None:
    """Say the gains of the wheels that differ, and no others."""
    if not own:
        document.pop("wheel_pid", None)
        return
    sections = document.setdefault("wheel_pid", tomlkit.table(is_super_table=True))
    for wheel in sections.keys() - own.keys():
        del sections[wheel]
    for wheel, gains in own.items():
        _put(sections.setdefault(wheel, tomlkit.table()), gains)


def _put(section: Table, gains: PidParameters) -> None:
    """Say the gains in a section: what stands there is changed in place, a default is not added."""
    for name, field in PidParameters.model_fields.items():
        value = getattr(gains, name)
        key = name if name in section else field.alias or name
        if value is None:
            section.pop(key, None)  # TOML has no word for it
        elif section.get(key, field.default) != value:
            section[key] = value


def _replace(path: Path, text: str) -> None:
    with tempfile.NamedTemporaryFile(
        "wb", dir=path.parent, prefix=f".{path.stem}.", suffix=".toml", delete=False
    ) as fresh:
        temporary = Path(fresh.name)
        try:
            _fill(fresh, text, path.stat())
            load(temporary)
            temporary.replace(path)
        except BaseException:
            temporary.unlink()
            raise
    _sync_folder(path.parent)


def _fill(fresh: IO[bytes], text: str, like: os.stat_result) -> None:
    """Write it through to the disk, with owner and mode of the file that it replaces."""
    fresh.write(text.encode())
    fresh.flush()
    os.fchown(fresh.fileno(), like.st_uid, like.st_gid)
    os.fchmod(fresh.fileno(), stat.S_IMODE(like.st_mode))
    os.fsync(fresh.fileno())


def _sync_folder(folder: Path) -> None:
    """Without this a power cut might bring the old file back."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
