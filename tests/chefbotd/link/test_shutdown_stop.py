"""A stop on a real pty whose far end does not read: it overtakes what is unsent, and is the last that is ever read."""

import asyncio
import contextlib
import fcntl
import os
import termios
import threading
import time
import tty
from array import array
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field

import pytest
import uvloop

from chefbotd.bus import Bus
from chefbotd.clock import SystemClock
from chefbotd.link import port as port_module
from chefbotd.link.port import BriefSerial, LinkParameters, SerialPortTransport, open_port
from chefbotd.link.session import BoardSession
from firmware_protocol import messages as wire
from firmware_protocol.codec import CLASSIC, to_board
from firmware_protocol.decoder import Decoder
from tests.fakes.classic_sketch import duty_in_force
from tests.waiting import PATIENCE_S, until, wait_until

pytestmark = pytest.mark.realtime

STOP = b"s 0 0\r"
MOTION = b"s 203 -201\r"
DUTY = (203, -201)
UNSENT = b"s 111 -111\r"
MOST_UNREAD = 4095
"""So many bytes the kernel keeps for who reads a terminal (N_TTY_BUF_SIZE - 1)."""


@dataclass
class FarEnd:
    """The board's end of a pty, which reads only when it is told to."""

    master: int
    path: str
    heard: bytes = b""

    def read(self) -> bytes:
        """Read whatever there is; all that was read so far."""
        with contextlib.suppress(OSError):  # nothing there, or nobody at the other end
            while data := os.read(self.master, 65536):
                self.heard += data
        return self.heard

    async def reads_until(self, words: bytes) -> None:
        """Read on until these are the last that have come."""
        await until(lambda: self.read().endswith(words))

    @property
    def unread_bytes(self) -> int:
        """How many bytes wait here to be read; a full line's other bytes wait behind them."""
        count = array("i", [0])
        fcntl.ioctl(self.master, termios.FIONREAD, count)
        return count[0]

    @property
    def duties(self) -> set[tuple[int, ...]]:
        """The motor command in force by what was heard, by our decoder and by the classic sketch's."""
        decoded = [message for _, message in Decoder(to_board(CLASSIC)).feed(self.heard)]
        strictly = [message.duty for message in decoded if isinstance(message, wire.SetDuty)]
        return {strictly[-1], duty_in_force(self.heard, DUTY)}


@pytest.fixture
def far_end() -> Iterator[FarEnd]:
    """A pty in raw mode; what a test leaves open is closed."""
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    path = os.ttyname(slave)
    os.close(slave)
    yield FarEnd(master, path)
    os.close(master)


@pytest.fixture(params=[asyncio.new_event_loop, uvloop.new_event_loop], ids=["asyncio", "uvloop"])
def runner(request: pytest.FixtureRequest) -> Iterator[asyncio.Runner]:
    """Both loops: the daemon's and the standard one."""
    with asyncio.Runner(loop_factory=request.param) as running:
        yield running


Story = Callable[[BoardSession, SerialPortTransport], Awaitable[None]]


def behind_a_full_port(runner: asyncio.Runner, far_end: FarEnd, story: Story) -> None:
    """Let a story happen while the kernel takes nothing more: a line is unsent or cut short, ``UNSENT`` behind it."""

    async def run() -> None:
        session = BoardSession(Bus(), SystemClock(), CLASSIC, device="pty", setpoints_per_s=200.0)
        session.expect_connection()
        transport = await open_port(LinkParameters(device=far_end.path), session)
        assert isinstance(transport, SerialPortTransport)
        await asyncio.sleep(0.01)
        session.send_duty(DUTY)
        before = (0, 0)

        def nothing_moves() -> bool:
            """The kernel passes nothing on any more, and took nothing since the look before this one."""
            nonlocal before
            while not transport.get_write_buffer_size():
                transport.write(MOTION)
            last, before = before, (far_end.unread_bytes, transport.get_write_buffer_size())
            return before == last and before[0] == MOST_UNREAD

        await until(nothing_moves)
        transport.write(UNSENT)
        await story(session, transport)
        session.close()
        await session.wait_closed()
        far_end.read()
        assert UNSENT not in far_end.heard

    runner.run(asyncio.wait_for(run(), PATIENCE_S))


def test_the_last_that_a_closed_port_brings_is_a_stop(runner: asyncio.Runner, far_end: FarEnd):
    """Closed with a line cut short and another waiting: the board that reads everything afterwards stands."""

    async def story(session: BoardSession, transport: SerialPortTransport) -> None:
        session.send_duty((7, 7))
        session.close()
        await session.wait_closed()
        far_end.read()
        assert far_end.heard.endswith(3 * STOP)
        assert far_end.duties == {(0, 0)}

    behind_a_full_port(runner, far_end, story)


def test_a_stop_does_not_wait_for_what_is_unsent(runner: asyncio.Runner, far_end: FarEnd):
    """Stopped and commanded again: the board that reads on finds the stop, and the new motion after it."""

    async def story(session: BoardSession, transport: SerialPortTransport) -> None:
        session.stop_motors()
        await far_end.reads_until(STOP)
        assert far_end.duties == {(0, 0)}
        session.send_duty((7, 7))
        await far_end.reads_until(b"s 7 7\r")
        assert far_end.duties == {(7, 7)}

    behind_a_full_port(runner, far_end, story)


def test_what_a_thread_has_overtaken_never_goes(runner: asyncio.Runner, far_end: FarEnd):
    """The loop stands still while a thread stops the motors; when it goes on, what was unsent before is dropped."""

    async def story(session: BoardSession, transport: SerialPortTransport) -> None:
        session.send_duty((7, 7))
        stopped: list[bool] = []
        thread = threading.Thread(target=lambda: stopped.append(session.stop_from_thread()))
        thread.start()
        thread.join()
        assert stopped == [True]
        await far_end.reads_until(STOP)
        assert far_end.duties == {(0, 0)}
        session.send_duty((8, 8))
        await far_end.reads_until(b"s 8 8\r")
        assert far_end.duties == {(8, 8)}

    behind_a_full_port(runner, far_end, story)


def test_a_socket_is_closed_with_a_stop_too(runner: asyncio.Runner):
    """It has no kernel buffer that could be looked at or dropped: the words are written, and the end follows them."""

    async def scenario() -> None:
        heard = asyncio.get_running_loop().create_future()

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            heard.set_result(await reader.read(-1))
            writer.close()

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        session = BoardSession(Bus(), SystemClock(), CLASSIC, device="socket", setpoints_per_s=200.0)
        session.expect_connection()
        await open_port(LinkParameters(device=f"socket://127.0.0.1:{port}"), session)
        await asyncio.sleep(0.01)
        session.send_duty(DUTY)
        session.close()
        await session.wait_closed()
        assert await heard == 2 * STOP + MOTION + 4 * STOP
        server.close()

    runner.run(asyncio.wait_for(scenario(), PATIENCE_S))


@dataclass
class Kernel:
    """What the driver of a real port holds, which a pty's does not: unsent bytes, until so many looks at them."""

    looks: float
    dropped: list[bytes] = field(default_factory=list)


class RealPort(BriefSerial):
    """A port that tells how much of its output is unsent."""

    kernel: Kernel
    far_end: FarEnd

    @property
    def out_waiting(self) -> int:
        """Six bytes, until they are gone."""
        self.kernel.looks -= 1
        return 6 if self.kernel.looks >= 0 else 0

    def reset_output_buffer(self) -> None:
        """Note what the far end has been given up to now: at least one more stop."""
        least = (len(self.kernel.dropped) + 1) * len(STOP)
        wait_until(lambda: len(self.far_end.read()) >= least)
        self.kernel.dropped.append(self.far_end.heard)


class Ending(asyncio.Protocol):
    """Waits for the end of its connection."""

    def __init__(self) -> None:
        self.lost = asyncio.Event()

    def connection_lost(self, exc: Exception | None) -> None:
        self.lost.set()


def closed_with(far_end: FarEnd, kernel: Kernel) -> float:
    """Close a port on whose way out bytes lie; how long it took."""

    async def run() -> float:
        device = RealPort(far_end.path)
        device.kernel, device.far_end = kernel, far_end
        protocol = Ending()
        transport = SerialPortTransport(asyncio.get_running_loop(), protocol, device)
        await asyncio.sleep(0)
        before_s = time.monotonic()
        transport.close_saying(STOP)
        await protocol.lost.wait()
        return time.monotonic() - before_s

    return asyncio.run(asyncio.wait_for(run(), PATIENCE_S))


def test_a_board_that_reads_in_time_is_told_once(far_end: FarEnd, monkeypatch: pytest.MonkeyPatch):
    """Ten looks, and the words are sent: nothing is dropped, nothing said again, however slow the looks are."""
    monkeypatch.setattr(port_module, "STALE_S", PATIENCE_S)
    kernel = Kernel(looks=10)
    closed_with(far_end, kernel)
    wait_until(lambda: far_end.read() == STOP)
    assert kernel.dropped == []


def test_what_does_not_go_makes_room_for_the_shutdown_stop(far_end: FarEnd, monkeypatch: pytest.MonkeyPatch):
    """What lies before them does not move: it is dropped, they are said again, and are dropped last, if at all."""
    monkeypatch.setattr(port_module, "FLUSH_TIMEOUT_S", 0.1)
    kernel = Kernel(looks=float("inf"))
    took_s = closed_with(far_end, kernel)
    wait_until(lambda: kernel.dropped == [STOP, 2 * STOP])  # the close, in a thread, drops what is left
    assert took_s >= port_module.STALE_S + port_module.FLUSH_TIMEOUT_S


def test_the_shutdown_stop_has_longer_than_the_sketch_waits_for_an_echo():
    """A board with USB of its own takes nothing for that second; systemd gives the daemon five."""
    assert 1.0 < port_module.STALE_S + port_module.FLUSH_TIMEOUT_S < 2.0
