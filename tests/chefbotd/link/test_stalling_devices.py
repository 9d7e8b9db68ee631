"""What may block at a device runs in a thread: each call is made with a far end that stalls, and the loop goes on.

Whatever stalls waits until the loop has run, and fails where it does not: then it was called in the loop.
"""

import asyncio
import contextlib
import os
import random
import socket
import threading
import tty
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import serial
import uvloop
from serial.urlhandler import protocol_socket

from chefbotd.bus import Bus
from chefbotd.clock import SystemClock
from chefbotd.link.device_threads import DEVICE_THREADS
from chefbotd.link.lidar.session import LidarSession, port_of
from chefbotd.link.port import BriefSerial, LinkParameters, SerialPortTransport, open_port
from chefbotd.link.reconnect import PortLink
from chefbotd.sensing.lidar import LidarParameters
from tests.waiting import PATIENCE_S, until

pytestmark = pytest.mark.realtime


class Stall:
    """A call that waits until the loop has run meanwhile; ``called`` says whether it was made at all."""

    def __init__(self) -> None:
        self._loop_ran = threading.Event()
        self.called = threading.Event()
        self.in_loop = False

    def __call__(self, *_: Any, **__: Any) -> None:
        """Wait for the loop."""
        self.called.set()
        self.in_loop |= not self._loop_ran.wait(PATIENCE_S)

    async def watch(self) -> None:
        """Let the call be made, and the loop run while it stalls."""
        await until(self.called.is_set)
        self._loop_ran.set()
        await asyncio.sleep(0)
        assert not self.in_loop


class Ending(asyncio.Protocol):
    """Waits for the end of its connection."""

    def __init__(self) -> None:
        self.lost = asyncio.Event()

    def connection_lost(self, exc: Exception | None) -> None:
        self.lost.set()


@pytest.fixture
def device() -> Iterator[str]:
    """A pty in raw mode, whose far end does nothing."""
    master, slave = os.openpty()
    tty.setraw(slave)
    yield os.ttyname(slave)
    os.close(slave)
    os.close(master)


@pytest.fixture(params=[asyncio.new_event_loop, uvloop.new_event_loop], ids=["asyncio", "uvloop"])
def runner(request: pytest.FixtureRequest) -> Iterator[asyncio.Runner]:
    """Both loops: the daemon's and the standard one."""
    with asyncio.Runner(loop_factory=request.param) as running:
        yield running


def stalling(owner: Any, name: str, monkeypatch: pytest.MonkeyPatch) -> Stall:
    """A method that stalls before it does what it always does.

    One of a port is that of the open port alone: an older port, which is closed when it is collected, would stall in the
    loop.
    """
    stall, method = Stall(), getattr(owner, name)

    def call(*args: Any, **kwargs: Any) -> Any:
        stall()
        return method(*args, **kwargs)

    monkeypatch.setattr(owner, name, call)
    return stall


Ends = Callable[[SerialPortTransport], None]

ENDS: dict[str, Ends] = {
    "abort": lambda transport: transport.abort(),
    "close": lambda transport: transport.close(),
    "last words": lambda transport: transport.close_behind(b"stop", dtr=True),
}


@pytest.mark.parametrize("end", ENDS)
def test_a_close_that_stalls_holds_nobody(
    runner: asyncio.Runner, device: str, end: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However the port is given up, the kernel's close is waited for in a thread."""

    async def run() -> None:
        protocol = Ending()
        transport = await open_port(LinkParameters(device=device), protocol)
        assert isinstance(transport, SerialPortTransport)
        stall = stalling(transport.serial, "close", monkeypatch)
        await asyncio.sleep(0)
        ENDS[end](transport)
        await stall.watch()
        await protocol.lost.wait()

    runner.run(asyncio.wait_for(run(), PATIENCE_S))


@pytest.mark.parametrize("name", ["flush", "reset_output_buffer"])
def test_a_drain_that_stalls_holds_nobody(
    runner: asyncio.Runner, device: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is unsent is dropped in the thread that closes."""
    monkeypatch.setattr(BriefSerial, "out_waiting", 1)

    async def run() -> None:
        transport = await open_port(LinkParameters(device=device), Ending())
        assert isinstance(transport, SerialPortTransport)
        stall = stalling(transport.serial, name, monkeypatch)
        await asyncio.sleep(0)
        transport.abort()
        await stall.watch()

    runner.run(asyncio.wait_for(run(), PATIENCE_S))


@pytest.mark.parametrize("name", ["_sent", "_set_dtr"])
def test_the_last_words_to_a_lidar_hold_nobody(
    runner: asyncio.Runner, device: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A lidar whose port takes nothing, or whose adapter does not answer: only that lidar is lost."""
    stall = stalling(SerialPortTransport, name, monkeypatch)
    lidar = LidarParameters.model_validate({"model": "rplidar_a1", "device": device})

    async def run() -> None:
        session = LidarSession(Bus(), SystemClock(), lidar)
        session.expect_connection()
        await open_port(port_of(lidar), session)
        await until(lambda: session.is_open)
        session.close()
        await stall.watch()
        await session.wait_closed()

    runner.run(asyncio.wait_for(run(), PATIENCE_S))


OPENS: dict[str, tuple[Any, str, str]] = {
    "a tty": (BriefSerial, "open", "pty"),
    "a socket": (protocol_socket.Serial, "open", "socket://127.0.0.1:9"),
    "a name look-up": (socket, "getaddrinfo", "socket://a.name.nobody.has:9"),
}


@pytest.mark.parametrize("what", OPENS)
def test_an_open_that_stalls_holds_nobody(
    runner: asyncio.Runner, device: str, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The device's open, a server that accepts late, a name server that does not answer."""
    owner, name, address = OPENS[what]
    stall = Stall()

    def call(*_: Any, **__: Any) -> None:
        stall()
        raise serial.SerialException("nobody there")

    async def run() -> None:
        monkeypatch.setattr(owner, name, call)
        parameters = LinkParameters(device=device if address == "pty" else address)
        opening = asyncio.ensure_future(open_port(parameters, Ending()))
        await stall.watch()
        with pytest.raises(OSError, match=r"nobody there|Could not open"):
            await opening

    runner.run(asyncio.wait_for(run(), PATIENCE_S))


def test_the_reason_why_a_port_cannot_be_opened_is_looked_up_in_a_thread(
    runner: asyncio.Runner, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It looks through all ports and processes."""
    from chefbotd.link import cannot_open

    stall = stalling(cannot_open, "advice", monkeypatch)

    async def run() -> None:
        opening = asyncio.ensure_future(open_port(LinkParameters(device="/dev/none"), Ending()))
        await stall.watch()
        with pytest.raises(OSError, match="/dev/none"):
            await opening

    runner.run(asyncio.wait_for(run(), PATIENCE_S))


def test_a_stream_that_ends_again_and_again_holds_nobody(
    runner: asyncio.Runner, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A server without its device: each connection ends at once. pyserial sleeps at each close, in a thread."""
    in_loop: list[str] = []

    def sleep(_: float) -> None:
        if threading.current_thread() is threading.main_thread():
            in_loop.append("slept in the loop")

    monkeypatch.setattr(protocol_socket.time, "sleep", sleep)

    async def run() -> None:
        server = await asyncio.start_server(lambda _, writer: writer.close(), "127.0.0.1", 0)
        host, number = server.sockets[0].getsockname()[:2]
        lidar = LidarParameters.model_validate({"model": "ld19", "device": f"socket://{host}:{number}"})
        session = LidarSession(Bus(), SystemClock(), lidar)
        parameters = port_of(lidar).model_copy(
            update={"reconnect_delay_s": 0.01, "max_reconnect_delay_s": 0.01}
        )
        link = PortLink(parameters, session, open_port, SystemClock(), random.Random(1))
        running = asyncio.ensure_future(link.run())
        await until(lambda: session.memory.opens >= 4)
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running
        server.close()

    runner.run(asyncio.wait_for(run(), PATIENCE_S))
    assert in_loop == []


def test_as_many_devices_as_there_are_may_stall_at_once(runner: asyncio.Runner) -> None:
    """Forty calls that stall, each in its thread: a further one is made all the same."""
    stalled, done = threading.Event(), threading.Event()

    async def run() -> None:
        loop = asyncio.get_running_loop()
        waiting = [loop.run_in_executor(DEVICE_THREADS, stalled.wait, PATIENCE_S) for _ in range(40)]
        await loop.run_in_executor(DEVICE_THREADS, done.set)
        stalled.set()
        assert await asyncio.gather(*waiting) == [True] * 40

    runner.run(asyncio.wait_for(run(), PATIENCE_S))
    assert done.is_set()


def test_what_a_call_raises_is_raised_to_who_awaits_it(runner: asyncio.Runner) -> None:
    """An error, as from any executor."""

    def fail() -> None:
        raise OSError("broken")

    async def run() -> None:
        with pytest.raises(OSError, match="broken"):
            await asyncio.get_running_loop().run_in_executor(DEVICE_THREADS, fail)

    runner.run(run())
