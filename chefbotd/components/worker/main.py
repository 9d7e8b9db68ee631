"""The worker's process: one thread works, and one reports twice a second that it lives and what it does."""

import base64
import contextlib
import ctypes
import os
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final, NamedTuple, NoReturn, TypeAlias

from chefbotd.components.worker.messages import (
    TO_WORKER,
    Alive,
    Answer,
    Configure,
    FrameReader,
    FromWorker,
    SkillRequest,
    frame_message,
    pack_body,
)
from chefbotd.components.worker.runner import Runner
from chefbotd.shared_clock import SHARED_CLOCK, SharedClock

PR_SET_PDEATHSIG: Final = 1  # prctl(2)
ALIVE_S: Final = 0.5
READ_BYTES: Final = 1 << 16
FOLLOWS_WITHIN_S: Final = 0.01
"""So long a turn waits for the next request of whoever has just got a result; the turns are 50 ms apart."""

NO_RESULT: Final = pack_body(None)
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

        runner = Runner(clock, None if len(arguments) > 3 else renew, clock.away)
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
    message = base64.b64encode(pack_body(configure)).decode("ascii")
    program = [
        sys.executable,
        "-P",
        "-m",
        "chefbotd.components.worker",
        *arguments,
        "0",
        message,
    ]  # it is nice already
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

    away = staticmethod(contextlib.nullcontext)
    """Nobody waits for this program anyway (see ``SharedClock.away``)."""


AnyClock: TypeAlias = _Clock | SharedClock


class _Line:
    """Where both threads write, a whole message at a time."""

    def __init__(self, theirs: socket.socket) -> None:
        self._socket, self.lock = theirs, threading.Lock()

    def send(self, message: FromWorker) -> None:
        frame = frame_message(message)
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
    inbox = _Inbox(theirs, line, runner)
    with contextlib.suppress(_Closed):
        while True:
            clock.sleep(runner.wait_s)
            if inbox.take().has_result:
                inbox.take_what_follows()
            line.send_all(runner.take_turn())


class _Closed(Exception):
    """The daemon has closed the socket."""


class _ReadMessages(NamedTuple):
    """Whether there were requests among the messages, and whether one was answered with more than that it was taken."""

    has_request: bool = False
    has_result: bool = False


def _can_read(theirs: socket.socket, within_s: float) -> bool:
    return bool(select.select([theirs], [], [], within_s)[0])


class _Inbox:
    """What the daemon sends. Raises ``_Closed`` at its end."""

    def __init__(
        self,
        theirs: socket.socket,
        line: _Line,
        runner: Runner,
        can_read: Callable[[socket.socket, float], bool] = _can_read,
    ) -> None:
        self._socket, self._line, self._runner, self._can_read = theirs, line, runner, can_read
        self._reader = FrameReader()

    def take(self) -> _ReadMessages:
        """All messages that have come."""
        try:
            data = self._socket.recv(READ_BYTES, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return _ReadMessages()
        if not data:
            raise _Closed
        has_request = has_result = False
        for frame in self._reader.feed(data):
            message = TO_WORKER.decode(frame)
            has_request = has_request or isinstance(message, SkillRequest)
            for answer in self._runner.take_message(message):
                self._line.send(answer)
                has_result = has_result or (isinstance(answer, Answer) and answer.body != NO_RESULT)
        return _ReadMessages(has_request, has_result)

    def take_what_follows(self) -> None:
        """Whoever has got a result may ask for more at once, a plan and then the drive: that is of the same turn."""
        until_s, left_s = time.monotonic() + FOLLOWS_WITHIN_S, FOLLOWS_WITHIN_S
        while self._can_read(self._socket, left_s) and not self.take().has_request:
            left_s = max(until_s - time.monotonic(), 0.0)
