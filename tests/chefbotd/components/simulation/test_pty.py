"""The simulated board's device, opened for real by a host in the same process."""

import asyncio
import os
import resource
import time
import tty
from collections.abc import Awaitable, Callable, Coroutine, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import uvloop

from chefbotd.components.simulation.pty import PtyBoard
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.realtime

Run = Callable[[Coroutine[Any, Any, None]], None]


@pytest.fixture(params=["asyncio", "uvloop"])
def run(request: pytest.FixtureRequest) -> Run:
    """Runs a coroutine on a real event loop of either kind: the kernel's side of a pty has no virtual time."""
    factory = {"asyncio": asyncio.new_event_loop, "uvloop": uvloop.new_event_loop}[request.param]

    def run_on_it(main: Coroutine[Any, Any, None]) -> None:
        with asyncio.Runner(loop_factory=factory) as runner:
            runner.run(main)

    return run_on_it


@contextmanager
def opened(device: Path) -> Iterator[int]:
    """The device as a host opens it."""
    descriptor = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        tty.setraw(descriptor)
        yield descriptor
    finally:
        os.close(descriptor)


async def readable(descriptor: int) -> bytes:
    """What the host reads next; waits for it."""
    loop = asyncio.get_running_loop()
    ready = asyncio.Event()
    loop.add_reader(descriptor, ready.set)
    try:
        await asyncio.wait_for(ready.wait(), PATIENCE_S)
    finally:
        loop.remove_reader(descriptor)
    return os.read(descriptor, 65_536)


class Ears:
    """The board's side: keeps what the host writes and lets tests wait for it."""

    def __init__(self) -> None:
        self._chunks: asyncio.Queue[bytes] = asyncio.Queue()

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""
        self._chunks.put_nowait(data)

    def next(self) -> Awaitable[bytes]:
        """The next bytes; waits for them."""
        return asyncio.wait_for(self._chunks.get(), PATIENCE_S)


def test_bytes_pass_both_ways(run: Run, tmp_path: Path) -> None:
    """Through the stable name, in raw mode: nothing is echoed, translated or buffered by line."""

    async def scenario() -> None:
        ears, link = Ears(), tmp_path / "chefbot"
        board = PtyBoard(ears.receive, link)
        device = board.plug()
        assert link.readlink() == device
        assert board.plug() == device
        with opened(link) as host:
            os.write(host, b"s 1 2\r\x03\x04")
            assert await ears.next() == b"s 1 2\r\x03\x04"
            os.write(host, b"r\r")
            assert await ears.next() == b"r\r"
            board.send(b"t\t1\t0.02\r\n\x00")
            assert await readable(host) == b"t\t1\t0.02\r\n\x00"
        board.unplug()
        assert board.bytes_dropped == 0

    run(scenario())


def test_unplugging_hangs_up_and_plugging_makes_a_fresh_device(run: Run, tmp_path: Path) -> None:
    """The host sees the end, the names vanish, and the stable name leads to the new device afterwards."""

    async def scenario() -> None:
        ears, link = Ears(), tmp_path / "chefbot"
        board = PtyBoard(ears.receive, link)
        board.plug()
        with opened(link) as host:
            os.write(host, b"x")
            await ears.next()
            board.unplug()
            assert await readable(host) == b""
            assert not link.is_symlink()
            assert board.device is None
            board.send(b"unheard")
            assert board.bytes_dropped == 7
            board.unplug()
            assert board.plug() == link.readlink()
        with opened(link) as host:
            os.write(host, b"again")
            assert await ears.next() == b"again"
        board.unplug()

    run(scenario())


def test_a_device_that_nobody_has_open_takes_nothing(run: Run) -> None:
    """Bytes sent while nobody listens are lost and counted: a host that opens later gets only fresh ones."""

    async def scenario() -> None:
        board = PtyBoard(Ears().receive)
        device = board.plug()
        board.send(b"stale")
        with opened(device) as host:
            board.send(b"fresh")
            assert await readable(host) == b"fresh"
        board.unplug()
        assert board.bytes_dropped == 5

    run(scenario())


def test_a_host_that_does_not_read_neither_blocks_nor_grows_the_board(run: Run) -> None:
    """Of 200 kB for a host that never reads, the kernel keeps at most 64 kB; the rest is counted as lost."""

    async def scenario() -> None:
        board = PtyBoard(Ears().receive)
        with opened(board.plug()):
            for _ in range(2000):
                board.send(bytes(100))
            assert 200_000 - 65_536 <= board.bytes_dropped < 200_000
        board.unplug()

    run(scenario())


def test_the_next_host_does_not_get_what_the_last_left_unread(run: Run) -> None:
    """What was sent to a host that closed without reading is gone when the next one opens."""

    async def scenario() -> None:
        ears = Ears()
        board = PtyBoard(ears.receive)
        device = board.plug()
        with opened(device) as host:
            os.write(host, b"here")
            await ears.next()
            board.send(b"unread")
        await asyncio.sleep(0.05)  # real time: the kernel's hang-up has no event that we could wait for
        with opened(device) as host:
            os.write(host, b"here too")
            assert await ears.next() == b"here too"
            board.send(b"new")
            assert await readable(host) == b"new"
        board.unplug()

    run(scenario())


def test_a_host_that_has_come_and_gone_between_two_looks_is_heard(run: Run) -> None:
    """The loop was held up meanwhile: a board in life would have read it all the same."""

    async def scenario() -> None:
        ears = Ears()
        board = PtyBoard(ears.receive)
        with opened(board.plug()) as host:
            os.write(host, b"s 0 0\r")
        assert await ears.next() == b"s 0 0\r"
        with opened(board.plug()) as host:
            os.write(host, b"s 7 7\r")
            assert await ears.next() == b"s 7 7\r"
        board.unplug()

    run(scenario())


def test_waiting_for_a_host_costs_next_to_nothing(run: Run) -> None:
    """A closed device hangs up for as long as it is closed; the board does not spin on that."""

    async def scenario() -> None:
        ears = Ears()
        board = PtyBoard(ears.receive)
        with opened(board.plug()) as host:
            os.write(host, b"x")
            await ears.next()
        before, began_s = resource.getrusage(resource.RUSAGE_SELF).ru_utime, time.monotonic()
        await asyncio.sleep(0.3)  # real time: what is measured is the processor time that passes meanwhile
        used_s = resource.getrusage(resource.RUSAGE_SELF).ru_utime - before
        assert used_s < 0.5 * (time.monotonic() - began_s)
        board.unplug()

    run(scenario())


def test_only_a_symbolic_link_is_ever_replaced(run: Run, tmp_path: Path) -> None:
    """A file in the way of the stable name is an error and stays; a stale link is replaced."""

    async def scenario() -> None:
        taken, stale = tmp_path / "taken", tmp_path / "stale"
        taken.write_text("precious")
        stale.symlink_to("/nowhere")
        board = PtyBoard(Ears().receive, taken)
        with pytest.raises(FileExistsError, match="not a symbolic link"):
            board.plug()
        assert taken.read_text() == "precious"
        assert board.device is None
        board = PtyBoard(Ears().receive, stale)
        assert board.plug() == stale.readlink()
        board.unplug()

    run(scenario())


def test_a_link_that_another_board_has_taken_is_left_alone(run: Run, tmp_path: Path) -> None:
    """The first board's unplugging does not take away the second one's name."""

    async def scenario() -> None:
        link = tmp_path / "chefbot"
        first, second = PtyBoard(Ears().receive, link), PtyBoard(Ears().receive, link)
        first.plug()
        device = second.plug()
        first.unplug()
        assert link.readlink() == device
        second.unplug()
        assert not link.is_symlink()

    run(scenario())
