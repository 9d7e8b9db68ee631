"""The disk operations of recording. Tests make each of them fail, or hang."""

import os
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Protocol

from chefbotd import storage


class OpenFile(Protocol):
    """A file that grows at its end."""

    def write(self, data: bytes) -> None:
        """Append all of it; raises ``OSError`` where that cannot be."""
        ...

    def sync(self) -> None:
        """Wait until what was written is on the disk."""
        ...

    def truncate(self, size: int) -> None:
        """Cut it."""
        ...

    def close(self) -> None:
        """Write no more."""
        ...


class _File:
    """A file of the operating system, without a buffer: what ``write`` has taken outlives a kill of this process."""

    def __init__(self, path: Path) -> None:
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        self._descriptor = os.open(path, flags, 0o640)

    def write(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(self._descriptor, rest) :]

    def sync(self) -> None:
        os.fdatasync(self._descriptor)

    def truncate(self, size: int) -> None:
        os.ftruncate(self._descriptor, size)
        os.lseek(self._descriptor, size, os.SEEK_SET)

    def close(self) -> None:
        os.close(self._descriptor)


class RecordingDisk:
    """The real file system."""

    def create(self, path: Path) -> OpenFile:
        """A new file; raises ``FileExistsError`` where there is one."""
        return _File(path)

    def make_folder(self, path: Path) -> None:
        """Make a folder and those above it, and see to it that its name is on the disk."""
        path.mkdir(parents=True, exist_ok=True)
        self.sync_folder(path)

    def sync_folder(self, path: Path) -> None:
        """Wait until the names in a folder are on the disk."""
        storage.sync_folder(path)

    def exists(self, path: Path) -> bool:
        """Whether there is such a file or folder."""
        return path.exists()

    def free_bytes(self, folder: Path) -> int:
        """What this user may still write."""
        return shutil.disk_usage(folder).free

    def files(self, folder: Path, pattern: str) -> Iterable[tuple[Path, int, float]]:
        """Path, size and time of change of each file; none where there is no folder."""
        for path in folder.glob(pattern):
            status = path.stat()
            yield path, status.st_size, status.st_mtime

    def ends_with(self, path: Path, end: bytes) -> bool:
        """Whether these are a file's last bytes."""
        with path.open("rb") as file:
            file.seek(0, os.SEEK_END)
            if file.tell() < len(end):
                return False
            file.seek(-len(end), os.SEEK_END)
            return file.read() == end

    def remove(self, path: Path) -> None:
        """Remove a file."""
        path.unlink(missing_ok=True)
