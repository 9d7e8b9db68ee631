"""A disk that fails at a chosen operation, in one of the ways in which disks and processes end."""

import errno
import os
from pathlib import Path

from chefbotd.components.maps.storage.disk import Content, Disk


class Killed(BaseException):
    """The process is gone: nothing after this is carried out."""


class FailingDisk(Disk):
    """The real file system, but for operation number ``at``.

    ``how`` is an errno that it raises then; or ``"kill"``: nothing is done from then on; or ``"power cut"``: likewise,
    and names that were not synchronised are as they were before.
    """

    def __init__(self, at: int, how: int | str) -> None:
        self.count, self._at, self._how = 0, at, how
        self._dead = False
        self._unsynced: list[tuple[Path, Path, bytes | None]] = []

    def _step(self) -> bool:
        """Whether to fail in this operation."""
        if self._dead:
            raise Killed
        self.count += 1
        return self.count == self._at

    def _fail(self) -> None:
        if isinstance(self._how, int):
            raise OSError(self._how, os.strerror(self._how), "somewhere")
        self._dead = True
        if self._how == "power cut":
            for path, target, replaced in reversed(self._unsynced):
                target.rename(path)
                if replaced is not None:
                    target.write_bytes(replaced)
        raise Killed

    def write(self, path: Path, content: Content) -> None:
        """Fail before, or with half of it written."""
        if self._step():
            self._fail()
        if self._step():
            super().write(path, content)
            path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
            self._fail()
        super().write(path, content)

    def make_folder(self, path: Path) -> None:
        """Fail before."""
        if self._step():
            self._fail()
        super().make_folder(path)

    def rename(self, path: Path, target: Path) -> None:
        """Fail before, or right after it."""
        if self._step():
            self._fail()
        replaced = target.read_bytes() if target.is_file() else None
        super().rename(path, target)
        self._unsynced.append((path, target, replaced))
        if self._step() and not isinstance(self._how, int):
            self._fail()

    def remove(self, path: Path) -> None:
        """Fail before."""
        if self._step():
            self._fail()
        super().remove(path)

    def remove_folder(self, path: Path) -> None:
        """Fail before, or with one file removed."""
        if self._step():
            self._fail()
        self._unsynced = [entry for entry in self._unsynced if entry[1] != path]
        if self._step():
            next(file for file in path.rglob("*") if file.is_file()).unlink()
            self._fail()
        super().remove_folder(path)

    def sync_folder(self, path: Path) -> None:
        """Fail before."""
        if self._step():
            self._fail()
        super().sync_folder(path)
        self._unsynced = [entry for entry in self._unsynced if entry[1].parent != path]


FULL, READ_ONLY, BROKEN = errno.ENOSPC, errno.EROFS, errno.EIO
