"""What a source of pictures is: a loop in a thread of its own, which hands out the newest picture."""

import asyncio
import threading
import time
from collections.abc import Awaitable, Callable
from typing import Protocol, TypeAlias

import structlog

from chefbotd.components.camera.algorithms.jpeg import Picture
from chefbotd.components.camera.parameters import CameraParameters
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence

log = structlog.get_logger(component="camera")

ENDING_S = 1.0


class CameraLost(Exception):
    """There are no pictures, or no more; the text says why, for people."""

    @property
    def words(self) -> str:
        """Why, with its id where it has one."""
        return self.args[0] if self.args else str(self)


class TakenPicture(Record, frozen=True):
    """A picture as a thread has taken it (``time.monotonic``); ``dropped`` were no pictures since the one before it."""

    picture: Picture
    taken_s: float
    dropped: int = 0


class ArrivedPicture(Record, frozen=True):
    """A picture as the loop reads it: how long ago it was taken, and how much since the one before was no picture."""

    picture: Picture
    age_s: float
    dropped: int = 0


class Capture(Protocol):
    """A source that blocks: it runs in a thread."""

    def run(self, deliver: Callable[[TakenPicture], None], ending: threading.Event) -> None:
        """Deliver pictures until ``ending``; releases the device, or ends its program, whatever happens.

        Raises:
            CameraLost: there are none, or no more.
        """
        ...


class PictureSource(Protocol):
    """A source as the loop sees it."""

    async def read(self) -> ArrivedPicture:
        """The newest picture that was not read yet; waits for one.

        Raises:
            CameraLost: there are no more.
        """
        ...

    async def close(self) -> None:
        """End it. Does not wait for a device that hangs in the kernel."""
        ...


OpenSource: TypeAlias = Callable[[CameraParameters], Awaitable[PictureSource]]
"""Opens the source of pictures; raises ``CameraLost``."""


class RateLimit:
    """Lets through as many a second as it may, as evenly as they come."""

    def __init__(self, rate_hz: float) -> None:
        self._period_s, self._due_s = 1.0 / rate_hz, float("-inf")

    def admit_at(self, stamp_s: float) -> bool:
        """Whether what came at this time is let through; a tenth of a period early is in time."""
        if stamp_s < self._due_s - 0.1 * self._period_s:
            return False
        is_late = stamp_s > self._due_s + self._period_s
        self._due_s = (stamp_s if is_late else self._due_s) + self._period_s
        return True


class ThreadSource:
    """Runs a capture in a thread. Of pictures that nobody has read yet, the newest is kept."""

    def __init__(self, capture: Capture) -> None:
        self._loop = asyncio.get_running_loop()
        self._lock = threading.Lock()
        self._newest: TakenPicture | None = None
        self._lost: CameraLost | None = None
        self._dropped = 0
        self._is_told = False
        self._arrived, self._ended = asyncio.Event(), asyncio.Event()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run_capture, args=(capture,), name="camera", daemon=True)
        self._thread.start()

    @property
    def is_running(self) -> bool:
        """Whether its thread has not ended."""
        return not self._ended.is_set()

    async def read(self) -> ArrivedPicture:
        """The newest picture that was not read yet."""
        while True:
            with self._lock:
                newest, self._newest, self._is_told = self._newest, None, False
                dropped, self._dropped = self._dropped, 0
                self._arrived.clear()
            if newest is not None:
                return ArrivedPicture(newest.picture, max(monotonic_s() - newest.taken_s, 0.0), dropped)
            if self._lost is not None:
                raise self._lost
            await self._arrived.wait()

    async def close(self) -> None:
        """Have the thread end, and wait for that for a second."""
        self._ending.set()
        try:
            async with asyncio.timeout(ENDING_S):
                await self._ended.wait()
        except TimeoutError:
            log.warning("the camera's device hangs: its thread cannot be ended")

    def _run_capture(self, capture: Capture) -> None:
        lost = CameraLost(Sentence("camera.switched_off", "it was switched off"))
        try:
            capture.run(self._deliver, self._ending)
        except CameraLost as reason:
            lost = reason
        except Exception as fault:  # said and logged: a camera's fault must not stop the robot
            log.error("a fault in the camera's thread", exc_info=fault)
            lost = CameraLost(Sentence("camera.program_fault", "a fault in the program: {why}", why=fault))
        finally:
            self._call_on_loop(self._end_source, lost)

    def _deliver(self, newest: TakenPicture) -> None:
        with self._lock:
            self._newest = newest
            self._dropped += newest.dropped
            is_told, self._is_told = self._is_told, True
        if not is_told:
            self._call_on_loop(self._arrived.set)

    def _end_source(self, lost: CameraLost) -> None:
        self._lost = lost
        self._arrived.set()
        self._ended.set()

    def _call_on_loop(self, function: Callable[..., object], *arguments: object) -> None:
        try:
            self._loop.call_soon_threadsafe(function, *arguments)
        except RuntimeError:  # the daemon has ended, and nobody looks any more
            self._ending.set()


def open_threads(make_capture: Callable[[CameraParameters], Capture]) -> OpenSource:
    """What opens a source in a thread; not while the thread before hangs in the kernel."""
    opened: list[ThreadSource] = []

    async def open_source(parameters: CameraParameters) -> PictureSource:
        if any(source.is_running for source in opened):
            raise CameraLost(
                Sentence("camera.hangs", "its device hangs: unplug the camera, or restart the computer")
            )
        opened[:] = [ThreadSource(make_capture(parameters))]
        return opened[0]

    return open_source


def monotonic_s() -> float:
    """The time of ``TakenPicture``: the one that Video4Linux stamps buffers with."""
    return time.monotonic()
