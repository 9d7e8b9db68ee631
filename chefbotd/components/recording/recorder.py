"""The recorder: pieces in, chunks out, into the ring and into the file that is being recorded.

It waits for the disk, so it runs in a thread of its own (``writer``). Whatever the disk does, its methods return or
raise a ``RecordingError``, and ``status`` says how things stand.
"""

import contextlib
import errno
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from chefbotd.components.recording.chunk import Channels, Chunk, ChunkBuilder, RawChunk, Ring, compressor
from chefbotd.components.recording.chunk_encoder import EventChunk
from chefbotd.components.recording.encoder import REPEATED
from chefbotd.components.recording.folder import MEGABYTE, RecordingDisk, RecordingFolder, file_name
from chefbotd.components.recording.foxglove import MapDrawer, ReadMap
from chefbotd.components.recording.parameters import RecordingParameters
from chefbotd.components.recording.status import AUTOMATIC, FAULT, RING, About, RecordedFile, RecordingError
from chefbotd.core.commands import RefusalKind
from chefbotd.core.events.robot import RecordingData
from chefbotd.core.sentence import Sentence
from chefbotd.storage import explain

if TYPE_CHECKING:
    from chefbotd.components.recording.mcap_file import RecordingFile

LOOK_AT_DISK_S = 1.0
FULL = (errno.ENOSPC, errno.EDQUOT)
GO_ON_EVERY_S = 10.0
"""How often a new automatic recording is tried where the last one has ended because the disk was full."""

MAP_AGAIN_NS = 30_000_000_000
"""So that any piece of the ring has the map."""


class Recorder:
    """Records what it is given. ``wall_s`` is the time since 1970, ``now_s`` in every call the daemon's own.

    ``read_map`` gives the cells of a stored map by its ``MapLoaded``.
    """

    def __init__(
        self,
        parameters: RecordingParameters,
        folder: Path,
        channels: Channels,
        offset_ns: int,
        *,
        about: Callable[[], About],
        read_map: ReadMap = lambda event: None,
        disk: RecordingDisk | None = None,
        wall_s: Callable[[], float] = time.time,
    ) -> None:
        self._parameters = parameters
        self._about, self._disk, self._wall_s = about, disk or RecordingDisk(), wall_s
        self._folder = RecordingFolder(parameters, folder, self._disk)
        self._offset_ns, self._channels = offset_ns, channels
        self._maps = MapDrawer(channels, read_map)
        self._compress = compressor(parameters.compression)
        self._ring = Ring(parameters.ring_s, round(parameters.ring_mb * MEGABYTE))
        self._holds: tuple[tuple[int, bytes], ...] = ()
        self._looked_s = self._synced_s = 0.0
        self._file: RecordingFile | None = None
        self._began_s = self._file_began_s = 0.0
        self._is_automatic = self._waits_for_room = False
        self._part = self._bytes_before = self._messages_before = 0
        self.status = RecordingData()

    # what is recorded

    def record(self, chunk: EventChunk, now_s: float) -> None:
        """Record a chunk."""
        if self._waits_for_room and now_s - self._looked_s >= GO_ON_EVERY_S:
            self._looked_s = now_s
            with contextlib.suppress(RecordingError):
                self.start(AUTOMATIC, now_s)
        self._add(chunk.raw, now_s)
        self._holds = chunk.holds
        drawn = ChunkBuilder()
        for event, log_ns, sequence in chunk.maps:
            self._maps.draw(event, log_ns, sequence, drawn)
        if chunk.raw.end_ns - self._maps.drawn_ns >= MAP_AGAIN_NS:
            self._maps.tell(chunk.raw.end_ns, REPEATED, drawn)
        if (raw := drawn.cut()) is not None:
            self._add(raw, now_s)
        self._note(now_s)

    def _add(self, raw: RawChunk, now_s: float) -> None:
        chunk = self._pack(raw)
        if self._parameters.ring_s > 0.0:
            self._ring.add(chunk)
        if self._file is not None:
            try:
                self._write(self._file, chunk, now_s)
            except OSError as error:
                self._fail(error)

    def _pack(self, raw: RawChunk) -> Chunk:
        return raw.pack(self._parameters.compression, self._compress)

    def _write(self, file: "RecordingFile", chunk: Chunk, now_s: float) -> None:
        file.add_chunk(chunk)
        if now_s - self._synced_s >= self._parameters.sync_s:
            file.sync()
            self._synced_s = now_s
        if now_s - self._looked_s >= LOOK_AT_DISK_S:
            self._looked_s = now_s
            if problem := self._look_at_disk():
                self._close_file(file)
                self._end_for(problem, full=True)
                return
        age_s, most_s = now_s - self._file_began_s, self._parameters.rotate_minutes * 60
        if file.size >= self._parameters.rotate_mb * MEGABYTE or age_s >= most_s:
            self._close_file(file)
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

    def start(self, name: str | None, now_s: float, *, from_beginning: bool = False) -> RecordingData:
        """Begin a file; ``name`` is the beginning of its name. ``from_beginning``: with all that was taken before.

        Raises:
            RecordingError: one is being recorded, the name cannot be, or the disk does not take it.
        """
        if self._file is not None:
            raise RecordingError(
                RefusalKind.ALREADY_RECORDING,
                Sentence(
                    "recording.already",
                    "{file} is being recorded, with all that happens: end it first; "
                    "the last minutes of it can be saved meanwhile",
                    file=self._file.path.name,
                ),
            )
        name = file_name(name) if name is not None else "recording"
        self._is_automatic = self._waits_for_room = name == AUTOMATIC
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
            raise self._folder.refusal(f"cannot write in {self._folder.path}", error) from error
        self._waits_for_room = False
        return self.status

    def stop(self, now_s: float) -> RecordingData:
        """End the file.

        Raises:
            RecordingError: nothing is being recorded, or the disk did not take the end of the file.
        """
        self._waits_for_room = False
        if self._file is None:
            raise RecordingError(RefusalKind.NOT_RECORDING, self._none())
        try:
            self._close_file(self._file)
        except OSError as error:
            self._fail(error)
            raise self._folder.refusal("the recording could not be ended", error) from error
        self.status = replace(self.status, state="idle", reason="")
        return self.status

    def close(self, now_s: float) -> None:
        """The daemon ends: end the file, if there is one."""
        if self._file is not None:
            self.stop(now_s)

    def save_ring(self, reason: str, now_s: float, *, fault: bool = False) -> RecordingData:
        """Write the ring into a file of its own, which is named after the reason; that of a ``fault`` may be removed.

        Raises:
            RecordingError: there is no ring, or the disk does not take it.
        """
        if self._parameters.ring_s <= 0.0:
            raise RecordingError(
                RefusalKind.STORAGE_FAILED,
                Sentence(
                    "recording.no_ring",
                    "nothing is kept in memory on this robot: that is switched off in its configuration",
                ),
            )
        self._require_room()
        try:
            path = self._folder.new_path(
                f"{FAULT if fault else RING}_{file_name(reason)}_{self._time_text()}"
            )
            file = self._create(path, reason)
            try:
                for chunk in self._ring.chunks:
                    file.add_chunk(chunk)
                file.finish()
            except OSError:
                self._abandon_file(file)
                raise
            self._folder.sync_names()
            self._folder.remove_old(self._current)
        except OSError as error:
            raise self._folder.refusal(f"cannot write in {self._folder.path}", error) from error
        self.status = replace(self.status, saved=str(path))
        return self.status

    def list_files(self) -> list[RecordedFile]:
        """Every file in the folder, the newest first.

        Raises:
            RecordingError: the folder cannot be read.
        """
        return self._folder.list_files(self._current)

    # inside

    def _open_part(self, now_s: float) -> "RecordingFile":
        self._part += 1
        name = self.status.name or "recording"
        path = self._folder.new_path(name if self._part == 1 else f"{name}_part{self._part}")
        self._file_began_s = self._synced_s = now_s
        file = self._file = self._create(path, name)
        self._folder.sync_names()
        self.status = replace(self.status, state="recording", file=str(path), reason="")
        self._folder.remove_old(self._current)
        return file

    def _tell_again(self, file: "RecordingFile", now_s: float) -> None:
        """Write what still holds at the beginning of a file."""
        again, log_ns = ChunkBuilder(), self._offset_ns + int(now_s * 1e9)
        for channel, payload in self._holds:
            again.add(channel, REPEATED, log_ns, payload)
        self._maps.tell(log_ns, REPEATED, again)
        if (raw := again.cut()) is not None:
            file.add_chunk(self._pack(raw))

    def _create(self, path: Path, reason: str) -> "RecordingFile":
        from chefbotd.components.recording.mcap_file import (
            RecordingFile,  # its library takes 3 MB: the ring does without
        )

        file = RecordingFile(self._disk, path, self._channels)
        try:
            file.begin()
            about = self._about()
            metadata = {"reason": reason, "part": str(self._part), "clock_offset_ns": str(self._offset_ns)}
            file.add_metadata("recording", metadata)
            for name, values in about.metadata.items():
                file.add_metadata(name, values)
            if about.urdf is not None:
                stamp_ns = round(self._wall_s() * 1e9)
                file.add_attachment("robot.urdf", "application/xml", about.urdf.encode(), stamp_ns)
        except OSError:
            self._abandon_file(file)
            raise
        return file

    def _close_file(self, file: "RecordingFile") -> None:
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
        name = Sentence("recording.the_recording", "the recording") if file is None else file.path.name
        self._end_for(
            Sentence("recording.has_ended", "{name} has ended: {why}", name=name, why=explain(error)),
            full=error.errno in FULL,
        )
        if file is not None:
            try:
                file.abandon()
            except OSError:
                return

    def _end_for(self, problem: str, *, full: bool) -> None:
        """Recording has ended; an automatic one goes on when a full disk has room again."""
        self._waits_for_room = full and self._is_automatic
        reason = (
            Sentence("recording.begins_again", "{why}; a new file begins when it has room", why=problem)
            if self._waits_for_room
            else problem
        )
        self.status = replace(self.status, state="failed", reason=reason)

    def _abandon_file(self, file: "RecordingFile") -> None:
        """Nothing of it is left, as far as the disk lets it be removed."""
        with contextlib.suppress(OSError):
            file.abandon()
        with contextlib.suppress(OSError):
            self._disk.remove(file.path)

    @property
    def _current(self) -> Path | None:
        return None if self._file is None else self._file.path

    def _require_room(self) -> None:
        try:
            problem = self._look_at_disk()
        except OSError as error:
            raise self._folder.refusal(f"cannot read {self._folder.path}", error) from error
        if problem:
            raise RecordingError(RefusalKind.STORAGE_FAILED, problem)

    def _look_at_disk(self) -> str | None:
        """The problem with a full disk; None if there is room, also after removing old files."""
        free_bytes = self._folder.make_room(self._current)
        self.status = replace(self.status, free_bytes=free_bytes)
        return self._folder.why_too_full(free_bytes)

    def _time_text(self) -> str:
        return datetime.fromtimestamp(self._wall_s(), UTC).strftime("%Y%m%dT%H%M%SZ")

    def _none(self) -> Sentence:
        if not self.status.reason:
            return Sentence("recording.none", "nothing is being recorded")
        return Sentence(
            "recording.none_because", "nothing is being recorded ({reason})", reason=self.status.reason
        )
