"""The recorder: events in, chunks out, into the ring and into the file that is being recorded.

It waits for the disk, so it runs in a thread of its own (``writer``). Whatever the disk does, its methods return or
raise a ``RecordingError``, and ``status`` says how things stand.
"""

import time
import unicodedata
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from chefbotd.core.commands import RefusalKind
from chefbotd.core.events.recording import EventsDropped
from chefbotd.recording.channels import Channels
from chefbotd.recording.chunk import MAGIC, Chunk, ChunkBuilder, compressor
from chefbotd.recording.disk import Disk
from chefbotd.recording.encoder import Encoder, ReadMap
from chefbotd.recording.errors import RecordingError, explain
from chefbotd.recording.mcap_file import RecordingFile
from chefbotd.recording.parameters import RecordingParameters
from chefbotd.recording.ring import Ring
from chefbotd.recording.status import AUTOMATIC, FAULT, About, Status, Stored

CHUNK_BYTES = 1 << 20
MEGABYTE = 1_000_000
LOOK_AT_DISK_S = 1.0
MAX_NAME = 64


class Recorder:
    """Records what it is given. ``wall_s`` is the time since 1970, ``now_s`` in every call the daemon's own."""

    def __init__(
        self,
        parameters: RecordingParameters,
        folder: Path,
        *,
        about: Callable[[], About],
        started_s: float,
        first_scanner: str | None = None,
        read_map: ReadMap = lambda event: None,
        disk: Disk | None = None,
        wall_s: Callable[[], float] = time.time,
    ) -> None:
        self._parameters, self.folder = parameters, folder
        self._about, self._disk, self._wall_s = about, disk or Disk(), wall_s
        self._offset_ns = round(wall_s() * 1e9) - round(started_s * 1e9)
        self._builder, self._channels = ChunkBuilder(), Channels()
        self._encoder = Encoder(self._builder, self._channels, self._offset_ns, first_scanner, read_map)
        self._compress = compressor(parameters.compression)
        self._ring = Ring(parameters.ring_s, round(parameters.ring_mb * MEGABYTE))
        self._chunk_began_s = self._looked_s = self._synced_s = started_s
        self._file: RecordingFile | None = None
        self._began_s = self._file_began_s = 0.0
        self._part = self._bytes_before = self._messages_before = 0
        self.status = Status()

    # what is recorded

    def take(self, events: Sequence[Any], now_s: float) -> None:
        """Record these events."""
        take, builder = self._encoder.take, self._builder
        for event in events:
            take(event)
            if builder.size >= CHUNK_BYTES:
                self._end_chunk(now_s)
        if now_s - self._chunk_began_s >= self._parameters.chunk_s:
            self._end_chunk(now_s)

    def note_gap(self, count: int, reason: str, now_s: float) -> None:
        """Say in the recording that events are missing; their numbers are missing too."""
        self._encoder.sequence += count
        self.take([EventsDropped(now_s, count, reason)], now_s)

    def _end_chunk(self, now_s: float) -> None:
        self._chunk_began_s = now_s
        chunk = self._builder.finish(self._parameters.compression, self._compress)
        if chunk is not None and self._parameters.ring_s > 0.0:
            self._ring.add(chunk)
        if self._file is not None:
            try:
                self._write(self._file, chunk, now_s)
            except OSError as error:
                self._fail(error)
        self._note(now_s)

    def _write(self, file: RecordingFile, chunk: Chunk | None, now_s: float) -> None:
        if chunk is not None:
            file.add_chunk(chunk)
        if now_s - self._synced_s >= self._parameters.sync_s:
            file.sync()
            self._synced_s = now_s
        if now_s - self._looked_s >= LOOK_AT_DISK_S:
            self._looked_s = now_s
            if problem := self._too_full():
                self._close(file)
                self.status = replace(self.status, state="failed", reason=problem)
                return
        age_s, most_s = now_s - self._file_began_s, self._parameters.rotate_minutes * 60
        if file.size >= self._parameters.rotate_mb * MEGABYTE or age_s >= most_s:
            self._close(file)
            self._tell_again(self._open_part(now_s), now_s)

    def _note(self, now_s: float) -> None:
        file = self._file
        changes: dict[str, Any] = {"ring_s": self._ring.seconds, "ring_bytes": self._ring.size}
        if file is not None:
            changes["bytes_written"] = self._bytes_before + file.size
            changes["messages"] = self._messages_before + file.messages
            changes["seconds"] = now_s - self._began_s
        self.status = replace(self.status, **changes)

    # files

    def start(self, name: str | None, now_s: float, *, from_beginning: bool = False) -> Status:
        """Begin a file; ``name`` is the beginning of its name. ``from_beginning``: with all that was taken before.

        Raises:
            RecordingError: one is being recorded, the name cannot be, or the disk does not take it.
        """
        if self._file is not None:
            raise RecordingError(
                RefusalKind.ALREADY_RECORDING,
                f"{self._file.path.name} is being recorded: stop_recording ends it",
            )
        name = file_name(name) if name is not None else "recording"
        if not from_beginning:
            self._end_chunk(now_s)
        self._require_room()
        began = f"{name}_{self._time_text()}"
        self._began_s, self._part, self._bytes_before, self._messages_before = now_s, 0, 0, 0
        self.status = replace(self.status, name=began, seconds=0.0, bytes_written=0, messages=0)
        try:
            file = self._open_part(now_s)
            if from_beginning:
                for chunk in self._ring.chunks:
                    file.add_chunk(chunk)
            else:
                self._tell_again(file, now_s)
        except OSError as error:
            self._fail(error)
            raise self._refusal(f"cannot write in {self.folder}", error) from error
        return self.status

    def stop(self, now_s: float) -> Status:
        """End the file.

        Raises:
            RecordingError: nothing is being recorded, or the disk did not take the end of the file.
        """
        if self._file is None:
            raise RecordingError(RefusalKind.NOT_RECORDING, f"nothing is being recorded{self._why()}")
        self._end_chunk(now_s)
        file = self._file
        if file is None:  # the disk did not take its last chunk
            raise RecordingError(RefusalKind.STORAGE_FAILED, self.status.reason)
        try:
            self._close(file)
        except OSError as error:
            self._fail(error)
            raise self._refusal("the recording could not be ended", error) from error
        self.status = replace(self.status, state="idle", reason="")
        return self.status

    def close(self, now_s: float) -> None:
        """The daemon ends: end the file, if there is one."""
        if self._file is not None:
            self.stop(now_s)

    def save_ring(self, reason: str, now_s: float) -> Status:
        """Write the ring into a file of its own, which is named after the reason.

        Raises:
            RecordingError: there is no ring, or the disk does not take it.
        """
        if self._parameters.ring_s <= 0.0:
            raise RecordingError(
                RefusalKind.STORAGE_FAILED, "nothing is kept in memory: [recording] ring_s is 0"
            )
        self._end_chunk(now_s)
        self._require_room()
        try:
            self._disk.make_folder(self.folder)
            path = self._free_path(f"{FAULT}_{file_name(reason)}_{self._time_text()}")
            file = self._create(path, reason)
            try:
                for chunk in self._ring.chunks:
                    file.add_chunk(chunk)
                file.finish()
            except OSError:
                file.abandon()
                raise
            self._disk.sync_folder(self.folder)
            self._remove_old()
        except OSError as error:
            raise self._refusal(f"cannot write in {self.folder}", error) from error
        self.status = replace(self.status, saved=str(path))
        return self.status

    def list_files(self) -> list[Stored]:
        """Every file in the folder, the newest first.

        Raises:
            RecordingError: the folder cannot be read.
        """
        current = None if self._file is None else self._file.path
        try:
            rows = [
                Stored(path.name, size, changed_s, self._disk.ends_with(path, MAGIC), path == current)
                for path, size, changed_s in self._disk.files(self.folder, "*.mcap")
            ]
        except OSError as error:
            raise self._refusal(f"cannot read {self.folder}", error) from error
        return sorted(rows, key=lambda row: row.changed_at_s, reverse=True)

    # inside

    def _open_part(self, now_s: float) -> RecordingFile:
        self._part += 1
        name = self.status.name or "recording"
        self._disk.make_folder(self.folder)
        path = self._free_path(name if self._part == 1 else f"{name}_part{self._part}")
        self._file_began_s = self._synced_s = now_s
        file = self._file = self._create(path, name)
        self._disk.sync_folder(self.folder)
        self.status = replace(self.status, state="recording", file=str(path), reason="")
        self._remove_old()
        return file

    def _tell_again(self, file: RecordingFile, now_s: float) -> None:
        """Write what still holds at the beginning of a file."""
        again = ChunkBuilder()
        self._encoder.tell_again(now_s, again)
        if (chunk := again.finish(self._parameters.compression, self._compress)) is not None:
            file.add_chunk(chunk)

    def _create(self, path: Path, reason: str) -> RecordingFile:
        file = RecordingFile(self._disk, path, self._channels)
        try:
            about = self._about()
            told = {"reason": reason, "part": str(self._part), "clock_offset_ns": str(self._offset_ns)}
            file.add_metadata("recording", told)
            for name, values in about.metadata.items():
                file.add_metadata(name, values)
            if about.urdf is not None:
                stamp_ns = round(self._wall_s() * 1e9)
                file.add_attachment("robot.urdf", "application/xml", about.urdf.encode(), stamp_ns)
        except OSError:
            file.abandon()
            raise
        return file

    def _close(self, file: RecordingFile) -> None:
        file.finish()
        self._bytes_before += file.size
        self._messages_before += file.messages
        self._file = None
        self.status = replace(
            self.status, state="idle", bytes_written=self._bytes_before, messages=self._messages_before
        )

    def _fail(self, error: OSError) -> None:
        """The disk does not take it: what is whole stays, and recording ends."""
        file, self._file = self._file, None
        name = "the recording" if file is None else file.path.name
        self.status = replace(self.status, state="failed", reason=f"{name} has ended: {explain(error)}")
        if file is not None:
            try:
                file.abandon()
            except OSError:
                return

    def _require_room(self) -> None:
        try:
            problem = self._too_full()
        except OSError as error:
            raise self._refusal(f"cannot read {self.folder}", error) from error
        if problem:
            raise RecordingError(RefusalKind.STORAGE_FAILED, problem)

    def _too_full(self) -> str | None:
        """Ask the disk how much is free, in the folder or in the first one above it that there is."""
        folder = self.folder
        while not self._disk.exists(folder) and folder != folder.parent:
            folder = folder.parent
        self.status = replace(self.status, free_bytes=self._disk.free_bytes(folder))
        free, least = self.status.free_bytes or 0, self._parameters.min_free_mb * MEGABYTE
        if free >= least:
            return None
        return (
            f"only {free / MEGABYTE:.0f} MB of the disk are free, "
            f"and {self._parameters.min_free_mb:g} MB are to stay so ([recording] min_free_mb)"
        )

    def _remove_old(self) -> None:
        """Remove the oldest files that nobody asked for, where they are too many."""
        current = None if self._file is None else self._file.path
        rows = [
            row
            for kind in (AUTOMATIC, FAULT)
            for row in self._disk.files(self.folder, f"{kind}_*.mcap")
            if row[0] != current
        ]
        rows.sort(key=lambda row: row[2])
        total = sum(size for _, size, _ in rows)
        for path, size, _ in rows[:-1]:
            if total <= self._parameters.automatic_mb * MEGABYTE:
                return
            self._disk.remove(path)
            total -= size

    def _free_path(self, name: str) -> Path:
        taken = {path.name for path, _, _ in self._disk.files(self.folder, f"{name}*.mcap")}
        names = (f"{name}.mcap", *(f"{name}_{number}.mcap" for number in range(2, 10_000)))
        return self.folder / next(each for each in names if each not in taken)

    def _time_text(self) -> str:
        return datetime.fromtimestamp(self._wall_s(), UTC).strftime("%Y%m%dT%H%M%SZ")

    def _why(self) -> str:
        return f" ({self.status.reason})" if self.status.reason else ""

    def _refusal(self, doing: str, error: OSError) -> RecordingError:
        return RecordingError(RefusalKind.STORAGE_FAILED, f"{doing}: {explain(error)}")


def file_name(text: str) -> str:
    """The beginning of a file's name, as it is kept.

    Raises:
        RecordingError: it cannot be one.
    """
    name = unicodedata.normalize("NFC", text)
    allowed = all(each in " -_." or unicodedata.category(each)[0] in "LMN" for each in name)
    if not (name and allowed and name[0] not in " -." and name[-1] not in " ."):
        raise RecordingError(
            RefusalKind.BAD_NAME,
            f"{text[:80]!r} cannot be a recording's name: expected letters, digits, spaces, hyphens, underscores and "
            "dots, the first one a letter, a digit or an underscore, the last one no space or dot",
        )
    if len(name) > MAX_NAME or len(name.encode()) > 2 * MAX_NAME:
        raise RecordingError(
            RefusalKind.BAD_NAME, f"{text[:80]!r} cannot be a recording's name: at most {MAX_NAME} characters"
        )
    return name
