"""Between a board and the daemon: a process that hands on what either says, and notes when which line went by.

The daemon opens the tap's pseudo-terminal in place of the board's device. The stamps are CLOCK_MONOTONIC: when an
``e`` line came from the board, and when an ``s`` came from the daemon.
"""

import gc
import multiprocessing
import os
import select
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path

from benchmarks.board import Journal


class Tap:
    """The parent's handle."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self.device: str = pipe.recv()

    def collect(self) -> Journal:
        """What went by since the last time."""
        self._pipe.send("collect")
        journal: Journal = self._pipe.recv()
        return journal


@contextmanager
def tap(board: Path) -> Iterator[Tap]:
    """A tap on the board's device, ended on the way out."""
    processes = multiprocessing.get_context("fork")
    ours, theirs = processes.Pipe()
    process = processes.Process(target=_run, args=(theirs, board), daemon=True)
    process.start()
    try:
        yield Tap(ours)
    finally:
        process.terminate()
        process.join()


def _run(pipe: Connection, board: Path) -> None:
    gc.disable()
    far = os.open(board, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(far)
    near, kept_open = os.openpty()
    tty.setraw(kept_open)
    pipe.send(os.ttyname(kept_open))
    journal, from_board, from_daemon = Journal(), b"", b""
    while True:
        ready, _, _ = select.select([far, near, pipe.fileno()], [], [])
        if far in ready:
            data, now_ns = os.read(far, 4096), time.monotonic_ns()
            os.write(near, data)
            *lines, from_board = (from_board + data).split(b"\n")
            journal.sent.update(line[:1].decode(errors="replace") for line in lines if line)
            journal.encoder_frames_ns += [now_ns for line in lines if line[:1] == b"e"]
        if near in ready:
            data, now_ns = os.read(near, 4096), time.monotonic_ns()
            os.write(far, data)
            *lines, from_daemon = (from_daemon + data).split(b"\r")
            journal.commands += [(now_ns, _duty(line)) for line in lines if line[:1] == b"s"]
        if pipe.fileno() in ready:
            pipe.recv()
            pipe.send(journal)
            journal = Journal()


def _duty(line: bytes) -> tuple[int, ...]:
    return tuple(map(int, line.split()[1:]))
