"""The worker inside the test's own process and loop: its real skills on the same virtual clock."""

import asyncio
import contextlib
import os
import socket

from chefbotd.clock import LoopClock
from chefbotd.components.worker.messages import TO_WORKER, Alive, FrameReader, frame_message
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.runner import Runner
from chefbotd.components.worker.spawn import Child

ALIVE_S = 0.5


async def no_worker(theirs: socket.socket, parameters: WorkerParameters) -> Child:
    """Stand in for the worker in a test that needs none.

    Raises:
        OSError: always.
    """
    raise OSError("this test has no worker")


async def worker_in_process(theirs: socket.socket, parameters: WorkerParameters) -> "WorkerInProcess":
    """A worker whose work takes no virtual time."""
    return WorkerInProcess(theirs.dup())


class WorkerInProcess(Child):
    """The worker's program on the loop of who made it."""

    def __init__(self, theirs: socket.socket) -> None:
        self._socket, self._loop = theirs, asyncio.get_running_loop()
        theirs.setblocking(False)
        theirs.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 22)  # all that a turn of the loop says
        self._runner, self._reader = Runner(LoopClock()), FrameReader()
        self._end: asyncio.Future[str] = self._loop.create_future()
        self._loop.add_reader(theirs, self._readable)
        self._turn()
        self._say_alive()

    @property
    def pid(self) -> int:
        """Of the process that it is in."""
        return os.getpid()

    def rss_mb(self) -> float | None:
        """It has no memory of its own."""
        return None

    def cpu_s(self) -> float | None:
        """Nor a processor's time."""
        return None

    def be_busy(self, busy_s: float) -> None:
        """Read nothing for so long, as while the work at hand takes its time."""
        self._loop.remove_reader(self._socket)
        self._loop.call_later(busy_s, self._read_again)

    def _read_again(self) -> None:
        if not self._end.done():
            self._loop.add_reader(self._socket, self._readable)

    def kill(self) -> None:
        """End at once."""
        self._finish("it was killed by SIGKILL")

    async def wait(self) -> str:
        """How it ended."""
        return await asyncio.shield(self._end)

    def _finish(self, how: str) -> None:
        if not self._end.done():
            self._loop.remove_reader(self._socket)
            self._socket.close()
            self._end.set_result(how)

    def _readable(self) -> None:
        data = self._socket.recv(1 << 20)
        if not data:
            self._runner.close()
            self._finish("it ended with exit code 0")
            return
        for frame in self._reader.feed(data):
            for message in self._runner.take_message(TO_WORKER.decode(frame)):
                self._send(frame_message(message))

    def _turn(self) -> None:
        if self._end.done():
            return
        for message in self._runner.take_turn():
            self._send(frame_message(message))
        self._loop.call_later(self._runner.wait_s, self._turn)

    def _say_alive(self) -> None:
        if not self._end.done():
            self._send(frame_message(Alive("", 0.0)))
            self._loop.call_later(ALIVE_S, self._say_alive)

    def _send(self, frame: bytes) -> None:
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self._socket.send(frame)
