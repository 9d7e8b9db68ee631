"""Disks that fail."""

import errno
import threading
from pathlib import Path

from chefbotd.components.recording.folder import OpenFile, RecordingDisk


class FailingFile:
    """Writes to ``inner`` until the disk says otherwise."""

    def __init__(self, disk: "FailingDisk", inner: OpenFile) -> None:
        self._disk, self._inner = disk, inner

    def write(self, data: bytes) -> None:
        """Half of it, where the disk fails: as a real one does."""
        self._disk.obey(lambda: self._inner.write(data[: len(data) // 2]))
        self._inner.write(data)

    def sync(self) -> None:
        """Also subject to the disk."""
        self._disk.obey()
        self._inner.sync()

    def truncate(self, size: int) -> None:
        """As usual, unless the disk is gone."""
        if self._disk.error == errno.EIO:
            raise OSError(errno.EIO, "gone")
        self._inner.truncate(size)

    def close(self) -> None:
        """As usual."""
        self._inner.close()


class FailingDisk(RecordingDisk):
    """Fails with ``error`` if it is set, hangs while ``hangs`` is, and has ``free`` bytes if that is set."""

    def __init__(self) -> None:
        self.error: int | None = None
        self.free: int | None = None
        self.goes_on = threading.Event()
        self.goes_on.set()
        self.entered = threading.Event()

    def obey(self, before_failing: object = None) -> None:
        """Hang or fail, as told."""
        if not self.goes_on.is_set():
            self.entered.set()
            self.goes_on.wait()
        if self.error is not None:
            if callable(before_failing):
                before_failing()
            raise OSError(self.error, "told to fail")

    def create(self, path: Path) -> OpenFile:
        """A file on this disk."""
        self.obey()
        return FailingFile(self, super().create(path))

    def free_bytes(self, folder: Path) -> int:
        """What it was told to say."""
        self.obey()
        return super().free_bytes(folder) if self.free is None else self.free


class SmallDisk(RecordingDisk):
    """Holds so many bytes of the folder's files; ``least`` is the least that was ever free when it was asked."""

    def __init__(self, capacity: int) -> None:
        self.capacity = self.least = capacity

    def free_bytes(self, folder: Path) -> int:
        """What the files have left."""
        free = self.capacity - sum(size for _, size, _ in self.files(folder, "*"))
        self.least = min(self.least, free)
        return free
