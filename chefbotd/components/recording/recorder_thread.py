"""The service's side of the recording thread: starts it, passes it work in turn, and notices a disk that hangs."""

import asyncio
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import structlog

from chefbotd.clock import Clock
from chefbotd.components.recording.status import RecordingError
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.robot import RecordingData
from chefbotd.rpc.jobs import ProgressReporter

if TYPE_CHECKING:
    from chefbotd.components.recording.recorder import Recorder
    from chefbotd.components.recording.writer import Writer
import gc
import time
import zlib
from typing import TYPE_CHECKING

from msgspec import Struct

from chefbotd.components.maps.events import MapLoaded
from chefbotd.components.recording.parameters import RecordingParameters
from chefbotd.core.geometry import Pose2D

if TYPE_CHECKING:
    from chefbotd.components.recording.chunk_encoder import ChunkEncoder
    from chefbotd.components.recording.foxglove import Cells
    from chefbotd.components.recording.recorder import Recorder
    from chefbotd.components.recording.writer import MakeRecorder


class RecordingHeader(Struct, frozen=True):
    """What a recording says about the robot. ``first_scanner`` names the scanner of the channel ``/scan``."""

    robot: str
    session: str
    configuration: Callable[[], str]
    urdf: Callable[[], str | None]
    first_scanner: str | None


def recorder_maker(
    parameters: RecordingParameters, folder: Path, made: RecordingHeader, started_s: float
) -> "MakeRecorder":
    """Makes encoder and recorder; ``started_s`` is the daemon's present time."""
    offset_ns = time.time_ns() - round(started_s * 1e9)

    def make() -> "tuple[ChunkEncoder, Recorder]":
        from chefbotd.components.recording.chunk import Channels
        from chefbotd.components.recording.chunk_encoder import ChunkEncoder
        from chefbotd.components.recording.recorder import Recorder
        from chefbotd.components.recording.status import about_robot

        gc.freeze()  # as after the start: no collection looks at all these classes
        encoder = ChunkEncoder(Channels(), offset_ns, made.first_scanner, parameters.chunk_s, started_s)
        recorder = Recorder(
            parameters,
            folder,
            encoder.channels,
            offset_ns,
            about=lambda: about_robot(made.robot, made.session, made.configuration, made.urdf()),
            read_map=read_map,
        )
        return encoder, recorder

    return make


def read_map(event: MapLoaded) -> "Cells | None":
    """Set the map in use by its cells; None if they cannot be read."""
    from chefbotd.components.maps.storage.manifest import CELLS
    from chefbotd.components.maps.storage.store import MapStore

    try:
        manifest, data = MapStore(Path(event.folder), 1).read_file(event.name, CELLS)
        cells = zlib.decompress(data)
    except (Refused, OSError, zlib.error):
        return None
    extent = manifest.extent
    origin = Pose2D(extent.x_m, extent.y_m, extent.heading_rad)
    return extent.resolution_m, origin, extent.columns, cells


T = TypeVar("T")

log = structlog.get_logger(component="recording")

DISK_PATIENCE_S = 15.0
"""How long a disk may take: a memory card may stop for seconds while it erases blocks."""

HANGS_AFTER_S = 3.0
"""The disk hangs after this time without progress; a busy computer delays the thread by a second, too."""


class RecorderThread:
    """``writer`` is None until the thread has loaded what it needs. ``hangs`` says that it waits for the disk."""

    def __init__(self, clock: Clock, folder: Path, start_writer: "Callable[[], Writer]") -> None:
        self._clock, self._folder, self._start_writer = clock, folder, start_writer
        self._starting: Writer | None = None
        self.writer: Writer | None = None
        self._done, self._waited_s = 0, 0.0
        self.hangs = False

    @property
    def status(self) -> RecordingData:
        """The recorder's state."""
        return RecordingData() if self.writer is None else self.writer.status

    @property
    def dropped(self) -> int:
        """The number of events that found no room."""
        return 0 if self.writer is None else self.writer.dropped

    @property
    def waiting(self) -> int:
        """The number of events that the thread has and has not written."""
        return 0 if self.writer is None else self.writer.waiting

    async def ready(self) -> "Writer":
        """Start the thread if none runs; returns the writer once it has loaded its modules."""
        if self.writer is None:
            try:
                self._starting = self._starting or self._start_writer()
                await asyncio.shield(asyncio.wrap_future(self._starting.ready))
            except Exception as error:
                raise _fail(f"the recorder cannot start: {error!r}") from error
            self.writer = self._starting
        return self.writer

    def watch_disk(self, elapsed_s: float) -> None:
        """Notice a thread that waits for the disk; ``elapsed_s`` is the time since the last look.

        A chunk that the thread got a moment ago proves nothing.
        """
        if self.writer is None:
            return
        done, self._done = self._done, self.writer.done
        waits = done == self._done and self.writer.waiting > 0
        self._waited_s = self._waited_s + elapsed_s if waits else 0.0
        self.hangs = self._waited_s > HANGS_AFTER_S

    async def ask(
        self,
        work: "Callable[[Recorder, float], T]",
        patience_s: float,
        *,
        before: Callable[[], object] | None = None,
    ) -> T:
        """Let the recorder do something at the present time, after the events that ``before`` passes to it.

        Without ``before`` the work comes first. Raises ``RecordingError`` if the disk does not answer in time.
        """
        try:
            async with asyncio.timeout(patience_s):
                writer = await self.ready()
                if before is not None:
                    before()
                now_s = self._clock.now_s()
                asked: Any = writer.ask(lambda recorder: work(recorder, now_s), now_s, first=before is None)
                answer: T = await asyncio.wrap_future(asked)
        except TimeoutError:
            raise _fail(f"the disk with {self._folder} has not answered for {patience_s:g} s") from None
        except Refused:
            raise
        except Exception as error:
            log.error("the recorder has failed", error=repr(error), exc_info=error)
            raise _fail(f"the recorder has failed: {error!r}") from error
        return answer


def _fail(problem: str) -> RecordingError:
    return RecordingError(RefusalKind.STORAGE_FAILED, problem)


async def waiting(work: Coroutine[Any, Any, T], progress: ProgressReporter) -> T:
    """Do it, and report every second that the disk is slow, so that a client continues to wait."""
    task = asyncio.ensure_future(work)
    try:
        seconds = 0
        while not (await asyncio.wait([task], timeout=1.0))[0]:
            seconds += 1
            progress.report(seconds, DISK_PATIENCE_S, "waiting for the disk")
        return task.result()
    finally:
        task.cancel()
