"""One clock for several simulated robots: it goes on when all their programs have done what was due, and no faster.

A computer that is too slow for all of them in real time has them all slowed down alike: to them nothing is late.
``python -m chefbotd.shared_clock SOCKET [PACE]`` is the clock. Who keeps to it (``SharedClock``)
says after each tick when it has nothing more to do; when all have, the next tick comes, at most at ``PACE`` times real
time.

No asyncio: the worker reads this clock too.
"""

import selectors
import socket
import struct
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

TICK_S: Final = 0.005
TIME: Final = struct.Struct("<d")
DONE: Final = b"."
SHARED_CLOCK: Final = "SHARED_CLOCK"
"""In a worker's environment: the socket of the clock that it keeps to, where its robot is simulated on one."""

CATCHES_UP_S: Final = 0.02
"""So much real time that was lost is made up for. A clock that raced would leave behind what the kernel brings in real
time: the bytes of pseudo-terminals and sockets."""

START_S: Final = 1000.0
"""The clock's first time."""


class SharedClock:
    """The present time, and this program's word that it waits for the next tick. One thread waits; any may read."""

    def __init__(self, path: Path) -> None:
        """Raises ``OSError``: there is no clock."""
        self._path = path
        self._now_s = START_S
        self._join()

    def _join(self) -> None:
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(str(self._path))
        self._is_done = True
        self.receive()

    @contextmanager
    def away(self) -> Iterator[None]:
        """Have nobody wait for this program meanwhile: it does what no robot's program could do in its own time.

        The clock goes on, and stands still here.
        """
        self.socket.close()
        try:
            yield
        finally:
            self._join()

    def now_s(self) -> float:
        """Seconds since the clock's start, and ``START_S``."""
        return self._now_s

    def done(self) -> None:
        """Nothing more is to be done before the next tick."""
        if not self._is_done:
            self._is_done = True
            self.socket.sendall(DONE)

    def receive(self) -> None:
        """Wait for the next tick. Raises ``ConnectionError`` when the clock has ended."""
        data = self.socket.recv(TIME.size, socket.MSG_WAITALL)
        if len(data) < TIME.size:
            raise ConnectionError("the shared clock has ended")
        (self._now_s,) = TIME.unpack(data)
        self._is_done = False

    def sleep(self, seconds: float) -> None:
        """Wait so long, for a tick at least."""
        until_s = self._now_s + seconds
        self.done()
        self.receive()
        while self._now_s < until_s:
            self.done()
            self.receive()


def next_due_s(due_s: float, now_s: float, real_tick_s: float) -> float:
    """When the tick after the one of ``due_s`` is due, in real time."""
    return max(due_s + real_tick_s, now_s - CATCHES_UP_S)


class ClockServer:
    """Gives ticks to all that are connected. Who goes is not waited for."""

    def __init__(self, path: Path, pace: float) -> None:
        """Raises ``OSError``: it cannot listen there; ``ValueError``: the pace is not above 0."""
        if not pace > 0:
            raise ValueError(f"expected a pace above 0, got {pace:g}")
        self._listening = socket.socket(socket.AF_UNIX)
        unfinished = path.with_name(f"{path.name}.new")
        self._listening.bind(str(unfinished))
        self._listening.listen(64)
        unfinished.rename(path)  # who finds it can connect
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listening, selectors.EVENT_READ)
        self._busy: set[socket.socket] = set()
        self._clients: set[socket.socket] = set()
        self._tick, self._real_tick_s = 0, TICK_S / pace

    def run(self) -> None:
        """Tick for ever."""
        due_s = time.monotonic()
        while True:
            while self._busy or not self._clients:
                self._serve_sockets(None)
            due_s = next_due_s(due_s, time.monotonic(), self._real_tick_s)
            while (left_s := due_s - time.monotonic()) > 0:
                self._serve_sockets(left_s)
            self._tick += 1
            for client in list(self._clients):
                self._send_time(client)

    def _serve_sockets(self, timeout_s: float | None) -> None:
        for key, _ in self._selector.select(timeout_s):
            if key.fileobj is self._listening:
                client, _address = self._listening.accept()
                self._selector.register(client, selectors.EVENT_READ)
                self._clients.add(client)
                self._send_time(client)
            elif isinstance(key.fileobj, socket.socket):
                self._take_word(key.fileobj)

    def _take_word(self, client: socket.socket) -> None:
        try:
            data = client.recv(64)
        except OSError:
            data = b""
        if data:
            self._busy.discard(client)
        else:
            self._forget_client(client)

    def _send_time(self, client: socket.socket) -> None:
        self._busy.add(client)
        try:
            client.sendall(TIME.pack(START_S + self._tick * TICK_S))
        except OSError:
            self._forget_client(client)

    def _forget_client(self, client: socket.socket) -> None:
        self._busy.discard(client)
        self._clients.discard(client)
        self._selector.unregister(client)
        client.close()


if __name__ == "__main__":
    ClockServer(Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 1.0).run()
