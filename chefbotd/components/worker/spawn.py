"""Starts the worker as a process, behind an interface that a test can replace."""

import asyncio
import os
import signal
import socket
import sys
from collections import deque
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Final, Protocol, TypeAlias

import structlog

from chefbotd.child import send_signal
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.shared_clock import SHARED_CLOCK

log = structlog.get_logger(component="worker")

PROC: Final = Path("/proc")
PAGE_MB: Final = os.sysconf("SC_PAGE_SIZE") / 1e6
TICKS_A_SECOND: Final = os.sysconf("SC_CLK_TCK")
LAST_LINES: Final = 20
LONGEST_LINE: Final = 4096


class Child(Protocol):
    """A started worker."""

    @property
    def pid(self) -> int:
        """Its process id."""
        ...

    def rss_mb(self) -> float | None:
        """Its resident memory, None where that is unknown."""
        ...

    def cpu_s(self) -> float | None:
        """The processor time that it has used, None where that is unknown."""
        ...

    def kill(self) -> None:
        """End it at once; harmless when it has ended."""
        ...

    async def wait(self) -> str:
        """Wait for its end; how it ended, in words."""
        ...


Spawn: TypeAlias = Callable[[socket.socket, WorkerParameters], Awaitable[Child]]
"""Start a worker that speaks through this socket, which is closed here afterwards."""


class ChildProcess:
    """``python -m chefbotd.components.worker``; what it writes to stderr goes to the log."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self._process = process
        self._last_lines: deque[str] = deque(maxlen=LAST_LINES)
        self._logging = asyncio.create_task(self._log_lines(), name="worker's stderr")

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def rss_mb(self) -> float | None:
        """Its resident memory, by /proc."""
        return rss_mb_of(self.pid)

    def cpu_s(self) -> float | None:
        """Its processor time in both modes, by /proc."""
        return cpu_s_of(self.pid)

    def kill(self) -> None:
        """SIGKILL: it may be stopped, or stuck in a library."""
        send_signal(self._process, signal.SIGKILL)

    async def wait(self) -> str:
        """Wait for its end; by which signal, or with which exit code and last line."""
        code = await self._process.wait()
        await asyncio.wait({self._logging}, timeout=0.5)
        self._logging.cancel()
        if code < 0:
            return f"it was killed by {signal.Signals(-code).name}"
        last = next((line for line in reversed(self._last_lines) if line), "")
        return f"it ended with exit code {code}" + (f": {last}" if last else "")

    async def _log_lines(self) -> None:
        stderr = self._process.stderr
        assert stderr is not None  # noqa: S101 - it was asked for
        while data := await stderr.read(LONGEST_LINE):
            for line in data.decode(errors="replace").splitlines():
                self._last_lines.append(line.strip())
                log.warning("the worker says", line=line)


def rss_mb_of(pid: int) -> float | None:
    """A process's resident memory, None where there is no /proc or no such process."""
    fields = _content(PROC / str(pid) / "statm").split()
    return int(fields[1]) * PAGE_MB if len(fields) > 1 else None


def cpu_s_of(pid: int) -> float | None:
    """The processor time that a process has used, in both modes."""
    fields = _content(PROC / str(pid) / "stat").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_A_SECOND if len(fields) > 12 else None


def _content(path: Path) -> str:
    """The file's text, empty when the process is gone or there is no /proc."""
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


async def spawn(
    theirs: socket.socket, parameters: WorkerParameters, *, shared_clock: Path | None = None
) -> Child:
    """Start the real one; it dies with the daemon (``main.tie_to_daemon``). ``shared_clock`` is that of a simulation.

    Raises:
        OSError: it cannot be started.
    """
    descriptor = theirs.fileno()
    arguments = [str(descriptor), str(os.getpid()), str(parameters.niceness)]
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-P",  # nothing from the folder that the daemon happens to run in
        "-m",
        "chefbotd.components.worker",
        *arguments,
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
        pass_fds=(descriptor,),
        env=environment(dict(os.environ), parameters.cache_folder, shared_clock),
        start_new_session=True,  # a Ctrl-C in the terminal is for the daemon
    )
    return ChildProcess(process)


def environment(
    daemons: dict[str, str], cache_folder: Path | None, shared_clock: Path | None = None
) -> dict[str, str]:
    """The worker's environment: one thread for arrays, a folder for compiled code, and nothing of systemd's."""
    excluded = ("NOTIFY_SOCKET", "WATCHDOG_USEC", SHARED_CLOCK)
    mine = {name: value for name, value in daemons.items() if name not in excluded}
    mine["OPENBLAS_NUM_THREADS"] = mine["OMP_NUM_THREADS"] = "1"
    if shared_clock is not None:
        mine[SHARED_CLOCK] = str(shared_clock)
    if cache_folder is not None:
        mine["NUMBA_CACHE_DIR"] = str(cache_folder)
    elif "CACHE_DIRECTORY" in daemons:
        mine.setdefault("NUMBA_CACHE_DIR", f"{daemons['CACHE_DIRECTORY'].split(':')[0]}/numba")
    return mine
