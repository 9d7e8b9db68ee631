"""The worker inside the test's own process and loop: its real skills on the same virtual clock."""

import asyncio
import contextlib
import os
import socket

from chefbotd.clock import LoopClock
from chefbotd.components.worker.messages import TO_WORKER, Alive, FrameReader, framed
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


async def worker_in_process(theirs: socket.socket, parameters: WorkerParameters) -> Child:
    """A worker whose work takes no virtual time."""
    return _InProcess(theirs.dup())


class _InProcess:
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
        return os.getpid()

    def rss_mb(self) -> float | None:
        return None

    def cpu_s(self) -> float | None:
        return None

    def kill(self) -> None:
        self._finish("it was killed by SIGKILL")

    async def wait(self) -> str:
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
                self._send(framed(message))

    def _turn(self) -> None:
        if self._end.done():
            return
        for message in self._runner.take_turn():
            self._send(framed(message))
        self._loop.call_later(self._runner.wait_s, self._turn)

    def _say_alive(self) -> None:
        if not self._end.done():
            self._send(framed(Alive("", 0.0)))
            self._loop.call_later(ALIVE_S, self._say_alive)

    def _send(self, frame: bytes) -> None:
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self._socket.send(frame)
