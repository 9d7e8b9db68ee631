"""A worker that does as the test says, at the other end of the same socketpair, on the same virtual clock."""

import asyncio
import socket
from collections.abc import Callable
from typing import TypeVar

from chefbotd.clock import LoopClock
from chefbotd.components.worker.messages import (
    TO_WORKER,
    Alive,
    Configure,
    FrameReader,
    FromWorker,
    Ready,
    ToWorker,
    frame_message,
)
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.process import Worker, WorkerStatus
from chefbotd.components.worker.spawn import Child

M = TypeVar("M")


class FakeChild:
    """A worker's far end: ``received`` is what it was told, ``answer`` what it does with each message."""

    def __init__(self, theirs: socket.socket, pid: int) -> None:
        self.pid = pid
        self.received: list[ToWorker] = []
        self.answer: Callable[[ToWorker], None] = lambda message: None
        self.memory_mb: float | None = 50.0
        self.used_s = 0.0
        self.killed = False
        self._loop = asyncio.get_running_loop()
        self._end: asyncio.Future[str] = self._loop.create_future()
        self._socket = theirs.dup()
        self._socket.setblocking(False)
        self._reader = FrameReader()
        self._reads = False
        self.read_on()

    def read_on(self) -> None:
        """Read what comes; it does from the beginning."""
        if not self._reads:
            self._loop.add_reader(self._socket, self._read)
            self._reads = True

    def stop_reading(self) -> None:
        """Leave unread what comes."""
        if self._reads:
            self._loop.remove_reader(self._socket)
            self._reads = False

    def say(self, message: FromWorker) -> None:
        """Tell the daemon something."""
        self.say_bytes(frame_message(message))

    def say_bytes(self, data: bytes) -> None:
        """Tell it anything."""
        self._socket.send(data)

    def die(self, how: str) -> None:
        """End of itself."""
        if not self._end.done():
            self.stop_reading()
            self._socket.close()
            self._end.set_result(how)

    def received_of(self, kind: type[M]) -> list[M]:
        """The messages of this kind."""
        return [message for message in self.received if isinstance(message, kind)]

    def rss_mb(self) -> float | None:
        """As the test says."""
        return self.memory_mb

    def cpu_s(self) -> float | None:
        """As the test says."""
        return self.used_s

    def kill(self) -> None:
        """It dies at once."""
        self.killed = self.killed or not self._end.done()
        self.die("it was killed by SIGKILL")

    async def wait(self) -> str:
        """Until it died, and how."""
        return await asyncio.shield(self._end)

    def _read(self) -> None:
        try:
            data = self._socket.recv(1 << 20)
        except ConnectionError:
            data = b""
        if not data:
            self.die("it ended with exit code 0")
            return
        for frame in self._reader.feed(data):
            message = TO_WORKER.decode(frame)
            self.received.append(message)
            self.answer(message)


class Nursery:
    """Starts fake workers; ``raise_child`` is called with each, ``children`` are all of them."""

    def __init__(self, raise_child: Callable[[FakeChild], None]) -> None:
        self.children: list[FakeChild] = []
        self.statuses: list[WorkerStatus] = []
        self.refuses = False
        self._raise = raise_child

    async def spawn(self, theirs: socket.socket, parameters: WorkerParameters) -> Child:
        """As ``chefbotd.components.worker.spawn.spawn`` does with real ones."""
        if self.refuses:
            raise OSError("no more processes")
        child = FakeChild(theirs, 4000 + len(self.children))
        self.children.append(child)
        self._raise(child)
        return child

    @property
    def last(self) -> FakeChild:
        """The present one."""
        return self.children[-1]

    def worker(self, parameters: WorkerParameters | None = None) -> Worker:
        """The daemon's side, whose workers come from here."""
        return Worker(
            parameters or WorkerParameters(),
            LoopClock(),
            {"counting": b"{}"},
            self.statuses.append,
            self.spawn,
        )


def healthy(child: FakeChild) -> None:
    """Become ready at once, and say twice a second that all is well."""

    def answer(message: ToWorker) -> None:
        if isinstance(message, Configure):
            child.say(Ready())

    child.answer = answer
    live(child)


def live(child: FakeChild) -> None:
    """Say twice a second that all is well, for as long as it lives."""
    loop = asyncio.get_running_loop()

    def say() -> None:
        if not child._end.done():
            child.say(Alive("", 0.0))
            loop.call_later(0.5, say)

    say()
