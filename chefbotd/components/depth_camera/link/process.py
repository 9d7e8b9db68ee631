"""A depth camera's process: how the daemon starts it, reads from it, and ends it."""

import asyncio
import signal
import struct
import sys
from collections import deque
from collections.abc import Awaitable, Callable, Iterator
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from chefbotd.child import send_signal
from chefbotd.components.depth_camera.parameters import DepthSourceParameters
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence

HEADER = struct.Struct("<4sdI")
BEARINGS, SCAN = b"bear", b"scan"
MOST_BEAMS = 4096

Floats: TypeAlias = npt.NDArray[np.floating[Any]]


class BadMessage(ValueError):
    """Bytes that no depth camera's process writes."""


class DepthMessage(Record, frozen=True, eq=False):
    """``kind`` is ``BEARINGS`` (the stamp means nothing) or ``SCAN``, whose stamp is on the daemon's clock."""

    kind: bytes
    stamp_s: float
    values: npt.NDArray[np.float64]


def encode(kind: bytes, stamp_s: float, values: Floats) -> bytes:
    """The message's bytes; values are kept to single precision."""
    return HEADER.pack(kind, stamp_s, len(values)) + values.astype("<f4").tobytes()


class MessageReader:
    """Bytes to messages; how the bytes are chunked makes no difference."""

    def __init__(self) -> None:
        self._data = b""

    def feed_bytes(self, data: bytes) -> Iterator[DepthMessage]:
        """The messages that ``data`` completes.

        Raises:
            BadMessage: it is not a depth camera's process that writes.
        """
        self._data += data
        while len(self._data) >= HEADER.size:
            kind, stamp_s, count = HEADER.unpack_from(self._data)
            if kind not in (BEARINGS, SCAN) or count > MOST_BEAMS:
                raise BadMessage(f"expected a scan from the camera's process, got {self._data[:16]!r}")
            end = HEADER.size + 4 * count
            if len(self._data) < end:
                return
            values = np.frombuffer(self._data[HEADER.size : end], "<f4").astype(np.float64)
            self._data = self._data[end:]
            yield DepthMessage(kind, stamp_s, values)


ENDING_S = 1.0
READ_BYTES = 1 << 16
PROGRAM = ("-m", "chefbotd.components.depth_camera.link")


class DepthChild(Protocol):
    """A camera's process."""

    async def read(self) -> bytes:
        """What it writes next; empty when it has ended."""
        ...

    async def end(self) -> str:
        """Kill it if it still runs; how it ended, in words. Does not wait for one that cannot be killed."""
        ...


Spawn: TypeAlias = Callable[[DepthSourceParameters], Awaitable[DepthChild]]
"""Starts a camera's process, or raises ``OSError``."""


class CameraProcess:
    """A Python program that serves one camera."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self._process = process
        self._last_lines: deque[str] = deque(maxlen=5)
        self._hearing = asyncio.create_task(self._read_stderr(), name="depth camera's stderr")

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def let_go(self) -> None:
        """Close its stdin, as the daemon's end does: it ends by itself."""
        assert self._process.stdin is not None  # noqa: S101 - it was asked for
        self._process.stdin.close()

    async def read(self) -> bytes:
        """What it writes next; empty when it has ended."""
        assert self._process.stdout is not None  # noqa: S101 - it was asked for
        return await self._process.stdout.read(READ_BYTES)

    async def end(self) -> str:
        """Kill it if it still runs, and give the last line that it said."""
        waiting = asyncio.create_task(self._process.wait(), name="depth camera's end")
        try:
            await asyncio.wait({waiting}, timeout=0.1)  # it may have ended by itself, and have said why
            send_signal(self._process, signal.SIGKILL)
            await asyncio.wait({waiting, self._hearing}, timeout=ENDING_S)
        finally:
            send_signal(self._process, signal.SIGKILL)
            self._hearing.cancel()
        if not waiting.done():
            return Sentence(
                "depth_camera.hangs",
                "process {pid} cannot be ended: it hangs in the kernel",
                pid=self._process.pid,
            )
        return (
            self._last_lines[-1]
            if self._last_lines
            else Sentence("depth_camera.ended", "it ended with exit code {code}", code=waiting.result())
        )

    async def _read_stderr(self) -> None:
        assert self._process.stderr is not None  # noqa: S101 - it was asked for
        while data := await self._process.stderr.read(4096):
            lines = data.decode(errors="replace").splitlines()
            self._last_lines += [line.strip() for line in lines if line.strip()]


async def spawn_program(parameters: DepthSourceParameters, *program: str) -> DepthChild:
    """Start this Python program (default: the real cameras') with the parameters as its last argument."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-P",  # nothing from the folder that the daemon happens to run in
        *(program or PROGRAM),
        parameters.model_dump_json(),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        start_new_session=True,  # a Ctrl-C in the terminal is for the daemon
    )
    return CameraProcess(process)
