"""The folders for lasting data on the robot's computer, and the texts for errors of its disk."""

import errno
import os
from collections.abc import Mapping
from pathlib import Path

_REASONS = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the quota of disk space is used up",
    errno.EROFS: "the file system is read-only",
    errno.EACCES: "this user has no permission",
    errno.EPERM: "this user has no permission",
    errno.EIO: "the disk cannot be read or written",
    errno.ENODEV: "the disk is gone",
}


def explain(error: OSError) -> str:
    """The reason in words."""
    number = error.errno or 0
    return _REASONS.get(number) or (os.strerror(number) if number else str(error))


def state_folder(name: str, environment: Mapping[str, str], *, simulated: bool) -> Path:
    """The folder ``name`` in ``StateDirectory=`` of the unit (systemd.exec(5)), else in XDG's folder for state.

    That of a simulated robot is ``simulated_NAME``, apart from the real one's.
    """
    name = f"simulated_{name}" if simulated else name
    unit, _, _ = environment.get("STATE_DIRECTORY", "").partition(":")
    if unit:
        return Path(unit) / name
    own = environment.get("XDG_STATE_HOME", "")
    state = Path(own) if own.startswith("/") else Path.home() / ".local" / "state"
    return state / "chefbotd" / name


def sync_folder(path: Path) -> None:
    """Wait until the names in a folder are on the disk."""
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
