"""The worker's process: a thread that works, and one that says twice a second that it lives, and at what it is."""

import contextlib
import ctypes
import os
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from chefbotd.worker.messages import TO_WORKER, Alive, FrameReader, FromWorker, framed
from chefbotd.worker.runner import Runner

PR_SET_PDEATHSIG: Final = 1  # prctl(2)
ALIVE_S: Final = 0.5
READ_BYTES: Final = 1 << 16
OUT_OF_MEMORY_SCORE: Final = "800"
"""When the computer is out of memory, the kernel ends the worker long before the daemon (0): proc(5), oom_score_adj."""


def main(arguments: list[str]) -> int:
    """Work until the daemon closes the socket; arguments: its descriptor, the daemon's pid, the niceness."""
    descriptor, daemon, niceness = (int(text) for text in arguments)
    tie_to_daemon(daemon)
    os.nice(niceness)
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(OUT_OF_MEMORY_SCORE, encoding="ascii")
    clock = _Clock()
    runner = Runner(clock)
    with socket.socket(fileno=descriptor) as theirs:
        theirs.setblocking(True)
        line = _Line(theirs)
        threading.Thread(target=_say_alive, args=(line, runner, clock), daemon=True, name="alive").start()
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            _work(theirs, line, runner)
        runner.close()
    return 0


def tie_to_daemon(daemon: int) -> None:
    """Die when the daemon does, however it dies: a worker that is stopped or stuck would not see the socket's end."""
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != daemon:  # it died before that
        sys.exit(1)
    for ignored in (signal.SIGINT, signal.SIGTERM):  # these are for the daemon, whose end closes the socket
        signal.signal(ignored, signal.SIG_IGN)


class _Clock:
    """The daemon's own clock (``chefbotd.clock.SystemClock``), without the 7 MB of asyncio that come with it."""

    def now_s(self) -> float:
        """Seconds since an arbitrary instant, never going back."""
        return time.clock_gettime(time.CLOCK_BOOTTIME)


class _Line:
    """Where both threads write, a whole message at a time."""

    def __init__(self, theirs: socket.socket) -> None:
        self._socket, self._lock = theirs, threading.Lock()

    def send(self, message: FromWorker) -> None:
        frame = framed(message)
        with self._lock:
            self._socket.sendall(frame)

    def send_all(self, messages: Iterable[FromWorker]) -> None:
        for message in messages:
            self.send(message)


def _say_alive(line: _Line, runner: Runner, clock: _Clock) -> None:
    pause = threading.Event()
    with contextlib.suppress(OSError):
        while True:
            what, since_s = runner.doing or ("", clock.now_s())
            line.send(Alive(what, clock.now_s() - since_s))
            pause.wait(ALIVE_S)


def _work(theirs: socket.socket, line: _Line, runner: Runner) -> None:
    reader = FrameReader()
    while True:
        readable, _, _ = select.select([theirs], [], [], runner.wait_s)
        if readable:
            data = theirs.recv(READ_BYTES)
            if not data:
                return
            for frame in reader.feed(data):
                line.send_all(runner.take_message(TO_WORKER.decode(frame)))
        line.send_all(runner.take_turn())
