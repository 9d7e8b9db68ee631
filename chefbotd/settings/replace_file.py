"""Replaces a configuration file in one step: never half a file, and never one that does not load."""

import os
import stat
import tempfile
from pathlib import Path
from typing import IO

import structlog

from chefbotd.settings.errors import SettingsError
from chefbotd.settings.loader import load
from chefbotd.storage import sync_folder

log = structlog.get_logger(__name__)


def read_writable(path: Path) -> str:
    """The text of a file that may be written to: one that may not must not be replaced either.

    Raises:
        OSError: it cannot be read, or may not be written.
    """
    with path.open("r+b") as file:
        return file.read().decode("utf-8-sig")


def replace_file(path: Path, text: str) -> None:
    """Write this text in the place of the file, in one step or not at all. It keeps the owner and the mode.

    A folder that cannot be synchronized after that is logged: the file is the new one for whoever reads it.

    Raises:
        SettingsError: the text is no configuration.
        OSError: the file cannot be replaced.
    """
    with _temporary(path) as fresh:
        temporary = Path(fresh.name)
        try:
            _fill(fresh, text, path.stat())
            _load_as(path, temporary)
            temporary.replace(path)
        except BaseException:
            temporary.unlink()
            raise
    try:
        sync_folder(path.parent)  # without this a power cut might bring the old file back
    except OSError as error:
        log.warning("a power cut may bring the old file back", path=str(path), error=str(error))


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
