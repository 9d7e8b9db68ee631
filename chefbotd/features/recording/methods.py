"""Recording: the methods that start and end a file, and the topic ``recording``."""

import asyncio
from collections.abc import Coroutine
from typing import Any, Protocol, TypeVar

from pydantic import Field

from chefbotd.core.events.recording import RecordingChanged
from chefbotd.rpc.jobs import Progress
from chefbotd.rpc.method import Caller, method
from chefbotd.rpc.models import NoParams, Params, Result, TopicData
from chefbotd.rpc.roles import Role
from chefbotd.rpc.topics import Topic

T = TypeVar("T")

DISK_PATIENCE_S = 15.0
"""A card may stand still for seconds while it clears its blocks."""


class StartRecordingParams(Params):
    """How the file's name begins."""

    name: str | None = Field(None, min_length=1, max_length=64, description="'recording' if none is given")


class SaveRingParams(Params):
    """Why: a part of the file's name."""

    reason: str | None = Field(None, min_length=1, max_length=64, description="'asked' if none is given")


class RecordingStarted(Result):
    """The file that is being written, on the robot's computer."""

    name: str
    file: str


class RecordingEnded(Result):
    """The last file of the recording, and what is in all of them; ``dropped`` counts what is missing."""

    name: str
    file: str
    seconds: float
    size_bytes: int
    messages: int
    dropped: int


class RingSaved(Result):
    """The file of the last minutes."""

    file: str
    seconds: float


class RecordedFile(Result):
    """A file in the folder. One that is not ``complete`` can be read up to where its writer ended."""

    file: str
    size_bytes: int
    changed_at_s: float = Field(description="seconds since 1970, UTC")
    complete: bool
    recording: bool


class RecordingList(Result):
    """Every recording, the newest first."""

    folder: str
    files: tuple[RecordedFile, ...]


class RecordingData(TopicData):
    """The recorder's state; ``reason`` says why recording has ended or is not possible."""

    state: str = Field(default="idle", description="idle, recording or failed")
    name: str | None = None
    file: str | None = Field(default=None, description="the one being written, or the last one")
    seconds: float = 0.0
    bytes_written: int = 0
    messages: int = 0
    dropped: int = Field(default=0, description="events that were dropped since the daemon started")
    waiting: int = 0
    ring_s: float = 0.0
    ring_bytes: int = 0
    free_bytes: int | None = None
    saved: str | None = Field(default=None, description="the file that was last saved from memory")
    reason: str = ""


class Recordings(Protocol):
    """What records. Each raises ``chefbotd.core.commands.Refused`` where it is not done."""

    async def start(self, name: str | None) -> RecordingStarted:
        """Begin a file."""
        ...

    async def stop(self) -> RecordingEnded:
        """End it."""
        ...

    async def list_recordings(self) -> RecordingList:
        """Every file."""
        ...

    async def save_ring(self, reason: str) -> RingSaved:
        """Write the last minutes into a file."""
        ...


async def waiting(work: Coroutine[Any, Any, T], progress: Progress) -> T:
    """Do it, and say every second that the disk is waited for, so that a client goes on waiting."""
    task = asyncio.ensure_future(work)
    try:
        seconds = 0
        while not (await asyncio.wait([task], timeout=1.0))[0]:
            seconds += 1
            progress.report(seconds, DISK_PATIENCE_S, "waiting for the disk")
        return task.result()
    finally:
        task.cancel()


class RecordingMethods:
    """The methods of this feature; each runs as a job, because the disk may take its time."""

    def __init__(self, recordings: Recordings) -> None:
        self._recordings = recordings

    @method(role=Role.DRIVE, moves=False)
    async def start_recording(
        self, caller: Caller, params: StartRecordingParams, progress: Progress
    ) -> RecordingStarted:
        """Record everything into a file on the robot's computer, until stop_recording."""
        return await waiting(self._recordings.start(params.name), progress)

    @method(role=Role.DRIVE, moves=False)
    async def stop_recording(self, caller: Caller, params: NoParams, progress: Progress) -> RecordingEnded:
        """End the recording."""
        return await waiting(self._recordings.stop(), progress)

    @method(role=Role.OBSERVE)
    async def list_recordings(self, caller: Caller, params: NoParams, progress: Progress) -> RecordingList:
        """Every recording in the robot's folder."""
        return await waiting(self._recordings.list_recordings(), progress)

    @method(role=Role.DRIVE, moves=False)
    async def save_ring(self, caller: Caller, params: SaveRingParams, progress: Progress) -> RingSaved:
        """Write the last minutes from the ring buffer in memory into a file."""
        return await waiting(self._recordings.save_ring(params.reason or "asked"), progress)


TOPICS = (Topic("recording", (RecordingChanged,), RecordingData, RecordingData.of, always_known=True),)
