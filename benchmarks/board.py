"""A lean board in a process of its own, which notes when it sent each encoder frame and read each motor command.

It is an instrument: a pty, the classic cycle and motors of the simplest kind, with nothing that could make it late.
Its stamps are CLOCK_MONOTONIC, which all processes share. ``Board`` is the handle, ``_Instrument`` the far side.
"""

import gc
import multiprocessing
import os
import select
import time
import tty
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection

COUNTS_PER_S_PER_DUTY = 80 / 60 * 4200 / 255  # 80 rpm of 4200 counts a turn at full duty
MOTOR_TIME_CONSTANT_S = 0.05
LINE_RATE_BYTES_S = 11_520.0


@dataclass(slots=True)
class Journal:
    """What went over the wire: nanoseconds, and for commands the duties; ``sent`` counts lines by their kind."""

    encoder_frames_ns: list[int] = field(default_factory=list)
    commands: list[tuple[int, tuple[int, ...]]] = field(default_factory=list)
    sent: Counter[str] = field(default_factory=Counter)
    bytes_sent: int = 0


class Board:
    """The parent's handle; silent until ``start``."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self.device: str = pipe.recv()

    def start(self, cycle_s: float, bytes_per_s: float = LINE_RATE_BYTES_S, echo_s: float = 0.0) -> None:
        """Send cycles, each as long as ``cycle_s`` or its bytes on the line, whichever is longer.

        ``t`` and ``e`` go out in one piece. The other lines follow in another after the ultrasonic sensor's
        ``echo_s``, for which the sketch stands still; without one they are in the same piece.
        """
        self._pipe.send(("start", cycle_s, bytes_per_s, echo_s))

    def feed(self, lines: bytes) -> None:
        """Send these bytes as fast as the line takes them; returns when it has taken all."""
        self._pipe.send(("feed", lines))
        self._pipe.recv()

    def pause(self) -> None:
        """Be silent again, at the end of a cycle."""
        self._pipe.send(("pause",))

    def collect(self) -> Journal:
        """What happened since the last time."""
        self._pipe.send(("collect",))
        journal: Journal = self._pipe.recv()
        return journal


@contextmanager
def board() -> Iterator[Board]:
    """A board process, ended on the way out."""
    processes = multiprocessing.get_context("fork")
    ours, theirs = processes.Pipe()
    process = processes.Process(target=_run, args=(theirs,), daemon=True)
    process.start()
    try:
        yield Board(ours)
    finally:
        process.terminate()  # it may be waiting for a daemon that no longer reads
        process.join()


def _run(pipe: Connection) -> None:
    gc.disable()
    _Instrument(pipe).run()


class _Instrument:
    """The far side: one ``select`` over the wire, the parent and the next cycle's time."""

    def __init__(self, pipe: Connection) -> None:
        self._master, self._slave = os.openpty()  # both ends stay open, so that the wire never hangs up
        tty.setraw(self._slave)
        self._pipe = pipe
        self._journal = Journal()
        self._booted_s = self._before_s = time.monotonic()
        self._cycle_s: float | None = None
        self._due_s = self._byte_s = self._echo_s = 0.0
        self._unread = b""
        self._duty: tuple[int, ...] = (0, 0)
        self._speeds = [0.0, 0.0]
        self._counts = [0.0, 0.0]
        pipe.send(os.ttyname(self._slave))

    def run(self) -> None:
        """Until the process is ended."""
        pipe = self._pipe.fileno()
        while True:
            wait_s = None if self._cycle_s is None else max(self._due_s - time.monotonic(), 0.0)
            ready, _, _ = select.select([self._master, pipe], [], [], wait_s)
            if self._master in ready:
                self._read()
            if pipe in ready:
                self._obey(*self._pipe.recv())
            if self._cycle_s is not None and time.monotonic() >= self._due_s:
                self._send_cycle(self._cycle_s)

    def _obey(self, word: str, *values: object) -> None:
        match (word, *values):
            case "start", float(cycle_s), float(bytes_per_s), float(echo_s):
                self._cycle_s, self._byte_s, self._echo_s = cycle_s, 1 / bytes_per_s, echo_s
                self._due_s = time.monotonic()
            case "feed", bytes(lines):
                self._write(lines)
                self._pipe.send(len(lines))
            case ("pause",):
                self._cycle_s = None
            case ("collect",):
                self._pipe.send(self._journal)
                self._journal = Journal()

    def _read(self) -> None:
        data = os.read(self._master, 4096)
        now_ns = time.monotonic_ns()
        *lines, self._unread = (self._unread + data).split(b"\r")
        for line in lines:
            kind, *duty = line.split(b" ")
            if kind == b"s":
                self._duty = tuple(map(int, duty))
                self._journal.commands.append((now_ns, self._duty))

    def _send_cycle(self, cycle_s: float) -> None:
        motion, others = self._lines()
        self._due_s += max(cycle_s, (len(motion) + len(others)) * self._byte_s)
        self._journal.encoder_frames_ns.append(time.monotonic_ns())
        if self._echo_s:
            self._write(motion)
            self._listen(self._echo_s)
            self._write(others)
        else:
            self._write(motion + others)

    def _listen(self, seconds: float) -> None:
        """Wait for an echo, and read what comes meanwhile."""
        end_s = time.monotonic() + seconds
        while (left_s := end_s - time.monotonic()) > 0:
            if select.select([self._master], [], [], left_s)[0]:
                self._read()

    def _write(self, lines: bytes) -> None:
        written = 0
        while written < len(lines):
            written += os.write(self._master, lines[written : written + 4096])
            self._drain()
        self._journal.bytes_sent += len(lines)
        self._journal.sent.update(line[:1].decode() for line in lines.split(b"\n") if line)

    def _drain(self) -> None:
        """Take what the daemon has written meanwhile, so that neither end waits for the other."""
        if select.select([self._master], [], [], 0)[0]:
            self._read()

    def _lines(self) -> tuple[bytes, bytes]:
        """A cycle: what comes before the ultrasonic sensor has its turn, and what comes after."""
        now_s = time.monotonic()
        elapsed_s, self._before_s = now_s - self._before_s, now_s
        self._turn(elapsed_s)
        micros = int((now_s - self._booted_s) * 1e6)
        left, right = map(int, self._counts)
        motion = f"t\t{micros}\t{elapsed_s:.2f}\ne\t{left}\t{right}\n"
        echoed = f"s\t{self._duty[0]}.00\t{self._duty[1]}.00\n"
        return motion.encode(), f"u\t51\n{echoed}i\t0.01\t-0.02\t0.71\t0.71\nb\t3050.00\n".encode()

    def _turn(self, elapsed_s: float) -> None:
        """Motors that follow their duty with one time constant."""
        share = min(elapsed_s / MOTOR_TIME_CONSTANT_S, 1.0)
        for wheel, duty in enumerate(self._duty):
            self._speeds[wheel] += share * (duty * COUNTS_PER_S_PER_DUTY - self._speeds[wheel])
            self._counts[wheel] += self._speeds[wheel] * elapsed_s
