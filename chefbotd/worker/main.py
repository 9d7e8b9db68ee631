"""The worker's process: one thread works, and one reports twice a second that it lives and what it does."""

import base64
import contextlib
import ctypes
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Final, NoReturn, TypeAlias

from chefbotd.shared_clock import SHARED_CLOCK, SharedClock
from chefbotd.worker.messages import TO_WORKER, Alive, Configure, FrameReader, FromWorker, framed, packed
from chefbotd.worker.runner import Runner

PR_SET_PDEATHSIG: Final = 1  # prctl(2)
ALIVE_S: Final = 0.5
READ_BYTES: Final = 1 << 16
OUT_OF_MEMORY_SCORE: Final = "800"
"""When the computer is out of memory, the kernel ends the worker long before the daemon (0): proc(5), oom_score_adj."""


def main(arguments: list[str]) -> int:
    """Work until the daemon closes the socket; arguments: its descriptor, the daemon's pid, the niceness.

    A fourth one is the configuration, for a process that begins again.
    """
    descriptor, daemon, niceness = (int(text) for text in arguments[:3])
    tie_to_daemon(daemon)
    os.nice(niceness)
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(OUT_OF_MEMORY_SCORE, encoding="ascii")
    clock = SharedClock(Path(path)) if (path := os.environ.get(SHARED_CLOCK)) else _Clock()
    with socket.socket(fileno=descriptor) as theirs:
        theirs.setblocking(True)
        line = _Line(theirs)

        def renew(configure: Configure) -> NoReturn:
            _begin_anew(line, arguments[:2], configure)

        runner = Runner(clock, None if len(arguments) > 3 else renew)
        threading.Thread(target=_say_alive, args=(line, runner, clock), daemon=True, name="alive").start()
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            for message in arguments[3:]:
                line.send_all(runner.take_message(TO_WORKER.decode(base64.b64decode(message))))
            _work(theirs, line, runner, clock)
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


def _begin_anew(line: "_Line", arguments: list[str], configure: Configure) -> NoReturn:
    """Become the same process with nothing in its memory: 150 MB stay with one that has compiled.

    Until the skills are ready, the daemon sends nothing but the configuration.
    """
    message = base64.b64encode(packed(configure)).decode("ascii")
    program = [sys.executable, "-P", "-m", "chefbotd.worker", *arguments, "0", message]  # it is nice already
    with line.lock:  # the other thread must not be cut off in the middle of a message
        os.execv(sys.executable, program)  # noqa: S606 - no shell


class _Clock:
    """The daemon's own clock (``chefbotd.clock.SystemClock``), without the 7 MB of asyncio that come with it."""

    def now_s(self) -> float:
        """Seconds since an arbitrary instant, never going back."""
        return time.clock_gettime(time.CLOCK_BOOTTIME)

    def sleep(self, seconds: float) -> None:
        """Wait so long."""
        time.sleep(seconds)


AnyClock: TypeAlias = _Clock | SharedClock


class _Line:
    """Where both threads write, a whole message at a time."""

    def __init__(self, theirs: socket.socket) -> None:
        self._socket, self.lock = theirs, threading.Lock()

    def send(self, message: FromWorker) -> None:
        frame = framed(message)
        with self.lock:
            self._socket.sendall(frame)

    def send_all(self, messages: Iterable[FromWorker]) -> None:
        for message in messages:
            self.send(message)


def _say_alive(line: _Line, runner: Runner, clock: AnyClock) -> None:
    pause = threading.Event()
    with contextlib.suppress(OSError):
        while True:
            what, since_s = runner.doing or ("", clock.now_s())
            line.send(Alive(what, clock.now_s() - since_s))
            pause.wait(ALIVE_S)


def _work(theirs: socket.socket, line: _Line, runner: Runner, clock: AnyClock) -> None:
    """Take, at each turn, all that has come: to wake up for each message costs more than most of them do."""
    reader = FrameReader()
    while True:
        clock.sleep(runner.wait_s)
        try:
            data = theirs.recv(READ_BYTES, socket.MSG_DONTWAIT)
        except BlockingIOError:
            data = None
        if data == b"":
            return
        for frame in reader.feed(data or b""):
            line.send_all(runner.take_message(TO_WORKER.decode(frame)))
        line.send_all(runner.take_turn())
