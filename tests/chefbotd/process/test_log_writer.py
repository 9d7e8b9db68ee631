"""Nobody who does not read the log holds up the robot."""

import contextlib
import os
from collections.abc import Iterator

import pytest

from chefbotd.process.logs import ROOM_FOR_LINES, LogWriter


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """Both ends of a pipe; the writing one stays open, lest a waiting thread meets another file under its number."""
    reading, writing = os.pipe()
    yield reading, writing
    with contextlib.suppress(OSError):
        os.close(reading)


def test_lines_arrive_in_order(pipe: tuple[int, int]):
    """Closing waits until all that was written is in the stream."""
    writer = LogWriter(pipe[1])
    for number in range(100):
        writer.write(f"{number}\n")
        writer.flush()
    writer.close()
    assert os.read(pipe[0], 10_000).decode().split() == [str(number) for number in range(100)]


def test_an_unread_pipe_blocks_nobody_and_the_loss_is_told(pipe: tuple[int, int]):
    """Ten times what fits: every write returns; once someone reads, a line says how many were lost."""
    writer = LogWriter(pipe[1])
    line = "x" * 1000 + "\n"
    for _ in range(10 * ROOM_FOR_LINES):
        writer.write(line)
    told = b""
    while b"log lines lost" not in told:
        told += os.read(pipe[0], 65536)
        writer.write("more\n")
    assert b'"lines": ' in told


def test_a_closed_pipe_is_no_error(pipe: tuple[int, int]):
    """The reader is gone: writing goes on, into nothing."""
    os.close(pipe[0])
    writer = LogWriter(pipe[1])
    writer.write("hello\n")
    writer.write("again\n")
    writer.close()


def test_closing_does_not_wait_for_a_reader_who_never_reads(pipe: tuple[int, int]):
    """Half a second of shutdown stop at most, and a full queue is not waited for at all."""
    writer = LogWriter(pipe[1])
    for _ in range(2 * ROOM_FOR_LINES):
        writer.write("x" * 1000)
    writer.close()
    assert len(os.read(pipe[0], 10)) == 10
