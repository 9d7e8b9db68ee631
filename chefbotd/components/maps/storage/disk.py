"""The file operations of saving a map. Tests make each of them fail."""

import hashlib
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, TypeAlias

from chefbotd import storage
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.sentence import Sentence
from chefbotd.storage import explain


class MapStoreError(Refused):
    """Something was not done; everything that was stored before is as it was."""


@contextmanager
def refusing_os_errors(doing: str, path: Path) -> Iterator[None]:
    """Turn a failure of the file system in this block into a ``MapStoreError``: what could not be done, and where."""
    try:
        yield
    except OSError as error:
        where = error.filename if isinstance(error.filename, str) else path
        raise MapStoreError(
            RefusalKind.STORAGE_FAILED,
            Sentence(
                "maps.disk",
                "cannot {doing}: {why} ({where})",
                doing=doing,
                why=explain(error),
                where=where,
            ),
        ) from error


Content: TypeAlias = bytes | Callable[[BinaryIO], object]
"""A file's bytes, or what writes them."""

TEMPORARY = ".tmp-"
"""How the names of files and folders begin that nobody needs once their writer is gone."""


class Disk:
    """The real file system."""

    def make_folder(self, path: Path) -> None:
        """Make a folder and those above it; one that exists is fine."""
        path.mkdir(parents=True, exist_ok=True)

    def write(self, path: Path, content: Content) -> None:
        """Write a new file, or a new content, and wait until it is on the disk."""
        with storage.create_file(path) as file:
            if isinstance(content, bytes):
                file.write(content)
            else:
                content(file)
            file.flush()
            os.fsync(file.fileno())

    def rename(self, path: Path, target: Path) -> None:
        """Give a file or a folder another name; a file of that name is replaced in the same moment."""
        path.rename(target)

    def remove(self, path: Path) -> None:
        """Remove a file, if there is one."""
        path.unlink(missing_ok=True)

    def remove_folder(self, path: Path) -> None:
        """Remove a folder with all that is in it."""
        shutil.rmtree(path)

    def sync_folder(self, path: Path) -> None:
        """Wait until the names in a folder are on the disk."""
        storage.sync_folder(path)


def replace(disk: Disk, path: Path, content: Content) -> None:
    """Write a file so that there is the old one or the new one at any moment, also after a power cut.

    Raises:
        OSError: it could not be written, or not made durable; the old one is there.
    """
    new, old = (path.with_name(f"{TEMPORARY}{prefix}{path.name}") for prefix in ("", "old-"))
    old.unlink(missing_ok=True)
    if path.exists():
        os.link(path, old)  # needs no room, and so does its way back
    has_new = False
    try:
        disk.write(new, content)
        disk.rename(new, path)
        has_new = True
        disk.sync_folder(path.parent)
    except OSError:
        if old.exists():
            old.replace(path)
        elif has_new:
            path.unlink(missing_ok=True)
        new.unlink(missing_ok=True)
        raise
    with suppress(OSError):  # the next change removes it
        old.unlink(missing_ok=True)


def sha256(path: Path) -> str:
    """The checksum of a file's content."""
    with storage.open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Keep every other process and thread from changing this folder's maps. The kernel ends it with the process.

    Raises:
        MapStoreError: another one has it for too long.
        OSError: the folder cannot be written.
    """
    with ExitStack() as stack:
        try:
            # A FIFO of that name can be locked as well, and is opened at once for reading and writing.
            stack.enter_context(storage.lock(folder / ".lock", os.O_RDWR | os.O_CREAT))
        except storage.Locked:
            why = Sentence("maps.locked", "another program has locked {folder} for too long", folder=folder)
            raise MapStoreError(RefusalKind.STORAGE_FAILED, why) from None
        yield
