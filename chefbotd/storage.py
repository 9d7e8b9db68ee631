"""The folders for lasting data on the robot's computer, and the texts for errors of its disk."""

import errno
import fcntl
import os
import stat
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import BufferedReader, BufferedWriter
from pathlib import Path

_REASONS = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the quota of disk space is used up",
    errno.EROFS: "the file system is read-only",
    errno.EACCES: "this user has no permission",
    errno.EPERM: "this user has no permission",
    errno.EIO: "the disk cannot be read or written",
    errno.ENODEV: "the disk is gone",
    errno.EFBIG: "the file is too large",
}

LOCK_PATIENCE_S, LOCK_PERIOD_S = 30.0, 0.02


class NotRegular(OSError):
    """A folder, a pipe, a socket or a device where a file is expected."""

    def __str__(self) -> str:
        return f"is no regular file: {self.filename}"


class Locked(OSError):
    """Another program has locked it for too long."""


def open_regular(path: Path) -> BufferedReader:
    """A regular file for reading. Opening or reading anything else, such as a FIFO, could wait for ever (open(2)).

    Raises:
        OSError: it cannot be opened, or is no regular file.
    """
    file = open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK))  # noqa: SIM115
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise NotRegular(errno.EINVAL, "no regular file", str(path))
    return file


def read_file(path: Path, most_bytes: int) -> bytes:
    """The content of a regular file.

    Raises:
        OSError: it cannot be read, is no regular file, or is larger than that.
    """
    with open_regular(path) as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise OSError(errno.EFBIG, f"larger than {most_bytes} bytes", str(path))
    return content


def create_file(path: Path, mode: int = 0o666) -> BufferedWriter:
    """A new or emptied regular file for writing; what else has that name is refused, and not waited for.

    ``mode`` are the permissions of a new one, but for what the process masks out (umask(2)).

    Raises:
        OSError: it cannot be made, or is no regular file.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NONBLOCK | os.O_CLOEXEC
    try:
        file = open(path, "wb", opener=lambda name, _: os.open(name, flags, mode))  # noqa: SIM115
    except OSError as error:
        if error.errno == errno.ENXIO:  # a FIFO that nobody reads
            raise NotRegular(errno.EINVAL, "no regular file", str(path)) from error
        raise
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise NotRegular(errno.EINVAL, "no regular file", str(path))
    return file


def replace_file(path: Path, content: bytes, mode: int = 0o666) -> None:
    """Write a file so that there is the old one or the new one at any moment, also after a power cut.

    It has the permissions ``mode`` from its first byte, but for what the process masks out.

    Raises:
        OSError: it could not be written; the old one is there. Or its folder could not be synchronized: the new one is
            there, and a power cut may bring the old one back.
    """
    new = path.with_name(f".{path.name}.new")
    new.unlink(missing_ok=True)  # of a write that a power cut has ended: it may have another mode
    with create_file(new, mode) as file:
        try:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
            new.replace(path)
        except OSError:
            new.unlink(missing_ok=True)
            raise
    sync_folder(path.parent)


@contextmanager
def lock(path: Path, flags: int = os.O_RDONLY) -> Iterator[None]:
    """Keep every other process and thread from what they lock by this file or folder. It ends with the process.

    Raises:
        Locked: another one has it for too long.
        OSError: it cannot be opened with these ``flags`` (os.open).
    """
    descriptor = os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC, 0o644)
    try:
        ends_s = time.monotonic() + LOCK_PATIENCE_S
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > ends_s:
                    raise Locked(errno.EWOULDBLOCK, "locked", str(path)) from None
                time.sleep(LOCK_PERIOD_S)
        yield
    finally:
        os.close(descriptor)


def explain(error: OSError) -> str:
    """The reason in words."""
    if isinstance(error, NotRegular):
        return "it is no regular file"
    if isinstance(error, Locked):
        return "another program has locked it for too long"
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
