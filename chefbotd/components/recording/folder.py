"""The folder of recordings: names for new files, free space, and removal of old files."""

import os
import shutil
import stat
import unicodedata
from collections.abc import Iterable
from pathlib import Path
from typing import Protocol

from chefbotd import storage
from chefbotd.components.recording.chunk import MAGIC
from chefbotd.components.recording.parameters import RecordingParameters
from chefbotd.components.recording.status import AUTOMATIC, FAULT, RecordedFile, RecordingError
from chefbotd.core.commands import RefusalKind
from chefbotd.core.sentence import Sentence
from chefbotd.storage import explain


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
        """Path, size and time of change of each regular file; none where there is no folder."""
        for path in folder.glob(pattern):
            try:
                status = path.stat()
            except FileNotFoundError:  # a link that leads nowhere, or a file that was removed meanwhile
                continue
            if stat.S_ISREG(status.st_mode):
                yield path, status.st_size, status.st_mtime

    def ends_with(self, path: Path, end: bytes) -> bool:
        """Whether these are a file's last bytes."""
        with storage.open_regular(path) as file:
            file.seek(0, os.SEEK_END)
            if file.tell() < len(end):
                return False
            file.seek(-len(end), os.SEEK_END)
            return file.read() == end

    def remove(self, path: Path) -> None:
        """Remove a file."""
        path.unlink(missing_ok=True)


MEGABYTE = 1_000_000
MAX_NAME = 64


class RecordingFolder:
    """``path`` need not exist yet. What is being recorded (``current``) is never removed."""

    def __init__(self, parameters: RecordingParameters, path: Path, disk: RecordingDisk) -> None:
        self._parameters, self.path, self._disk = parameters, path, disk

    def new_path(self, name: str) -> Path:
        """A path for a new file whose name begins so; makes the folder where there is none."""
        self._disk.make_folder(self.path)
        existing = {path.name for path, _, _ in self._disk.files(self.path, f"{name}*.mcap")}
        names = (f"{name}.mcap", *(f"{name}_{number}.mcap" for number in range(2, 10_000)))
        return self.path / next(candidate for candidate in names if candidate not in existing)

    def sync_names(self) -> None:
        """Wait until the names in the folder are on the disk."""
        self._disk.sync_folder(self.path)

    def list_files(self, current: Path | None) -> list[RecordedFile]:
        """Every file in the folder, the newest first.

        Raises:
            RecordingError: the folder cannot be read.
        """
        try:
            rows = [
                RecordedFile(path.name, size, changed_s, self._disk.ends_with(path, MAGIC), path == current)
                for path, size, changed_s in self._disk.files(self.path, "*.mcap")
            ]
        except OSError as error:
            raise self.refusal(f"cannot read {self.path}", error) from error
        return sorted(rows, key=lambda row: row.changed_at_s, reverse=True)

    def free_bytes(self) -> int:
        """What the disk has free, in the folder or in the first existing one above it."""
        folder = self.path
        while not self._disk.exists(folder) and folder != folder.parent:
            folder = folder.parent
        return self._disk.free_bytes(folder)

    def why_too_full(self, free_bytes: int) -> str | None:
        """What to say of a disk with so much left; None: it has room."""
        if free_bytes >= self._parameters.min_free_mb * MEGABYTE:
            return None
        return Sentence(
            "recording.disk_full",
            "only {free_mb:.0f} MB of the disk are free, and {least_mb:g} MB must stay free",
            free_mb=free_bytes / MEGABYTE,
            least_mb=self._parameters.min_free_mb,
        )

    def make_room(self, current: Path | None) -> int:
        """What the disk has free; if too little, after the oldest files that nobody asked for were removed.

        None is, where all of them would not be enough.
        """
        free_bytes = self.free_bytes()
        missing = self._parameters.min_free_mb * MEGABYTE - free_bytes
        rows = self._automatic(current) if missing > 0 else []
        if not rows or sum(size for _, size, _ in rows) < missing:
            return free_bytes
        for path, size, _ in rows:
            if missing > 0:
                self._disk.remove(path)
                missing -= size
        return self.free_bytes()

    def _automatic(self, current: Path | None) -> list[tuple[Path, int, float]]:
        """The files that nobody asked for, but for the current one, the oldest first."""
        kinds = (self._disk.files(self.path, f"{kind}_*.mcap") for kind in (AUTOMATIC, FAULT))
        rows = [row for files in kinds for row in files if row[0] != current]
        return sorted(rows, key=lambda row: row[2])

    def remove_old(self, current: Path | None) -> None:
        """Remove the oldest files that nobody asked for, where they are too many."""
        rows = self._automatic(current)
        total = sum(size for _, size, _ in rows)
        for path, size, _ in rows[:-1]:
            if total <= self._parameters.automatic_mb * MEGABYTE:
                return
            self._disk.remove(path)
            total -= size

    def refusal(self, doing: str, error: OSError) -> RecordingError:
        """The disk's error, as a ``RecordingError``."""
        return RecordingError(
            RefusalKind.STORAGE_FAILED,
            Sentence("recording.disk", "{doing}: {why}", doing=doing, why=explain(error)),
        )


def file_name(text: str) -> str:
    """The beginning of a file's name, as it is kept.

    Raises:
        RecordingError: it cannot be one.
    """
    name = unicodedata.normalize("NFC", text)
    allowed = all(character in " -_." or unicodedata.category(character)[0] in "LMN" for character in name)
    if not (name and allowed and name[0] not in " -." and name[-1] not in " ."):
        raise RecordingError(
            RefusalKind.BAD_NAME,
            Sentence(
                "recording.bad_name",
                "{name!r} cannot be a recording's name: expected letters, digits, spaces, hyphens, "
                "underscores and dots, the first one a letter, a digit or an underscore, "
                "the last one no space or dot",
                name=text[:80],
            ),
        )
    if len(name) > MAX_NAME or len(name.encode()) > 2 * MAX_NAME:
        raise RecordingError(
            RefusalKind.BAD_NAME,
            Sentence(
                "recording.long_name",
                "{name!r} cannot be a recording's name: at most {most} characters",
                name=text[:80],
                most=MAX_NAME,
            ),
        )
    return name
