"""Opening real device files: ptys and sockets of this machine."""

import asyncio
import contextlib
import os
import termios
import tty
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
import uvloop
from pydantic import ValidationError

from chefbotd.link.port import FirmwareMode, LinkParameters, open_port


class Recorder(asyncio.Protocol):
    """Remembers what happened to its connection."""

    def __init__(self) -> None:
        self.data = asyncio.Event()
        self.received = b""
        self.lost: asyncio.Future[Exception | None] = asyncio.get_running_loop().create_future()

    def data_received(self, data: bytes) -> None:
        self.received += data
        self.data.set()

    def connection_lost(self, exc: Exception | None) -> None:
        self.lost.set_result(exc)


@dataclass
class Pty:
    """Both ends of a pseudo-terminal."""

    master: int
    path: str


@pytest.fixture
def pty() -> Iterator[Pty]:
    """A pty in raw mode; what a test leaves open is closed."""
    master, slave = os.openpty()
    tty.setraw(slave)
    path = os.ttyname(slave)
    os.close(slave)
    yield Pty(master, path)
    with contextlib.suppress(OSError):
        os.close(master)


@pytest.fixture(params=[asyncio.new_event_loop, uvloop.new_event_loop], ids=["asyncio", "uvloop"])
def runner(request: pytest.FixtureRequest) -> Iterator[asyncio.Runner]:
    """Both loops: the daemon's and the standard one."""
    with asyncio.Runner(loop_factory=request.param) as running:
        yield running


def test_bytes_go_both_ways(pty: Pty, runner: asyncio.Runner):
    """What the board writes is received, and a write is at the board when it returns."""

    async def scenario() -> None:
        protocol = Recorder()
        transport = await open_port(LinkParameters(device=pty.path), protocol)
        os.write(pty.master, b"u\t12\n")
        await protocol.data.wait()
        assert protocol.received == b"u\t12\n"
        transport.write(b"s 1 2\r")
        assert os.read(pty.master, 100) == b"s 1 2\r"
        transport.abort()
        transport.abort()
        await protocol.lost

    runner.run(scenario())


def test_a_hang_up_is_noticed(pty: Pty, runner: asyncio.Runner):
    """When the board's end closes, the connection is lost without anyone writing."""

    async def scenario() -> None:
        protocol = Recorder()
        await open_port(LinkParameters(device=pty.path), protocol)
        await asyncio.sleep(0)
        os.close(pty.master)
        await protocol.lost

    runner.run(scenario())


def test_a_peer_that_never_reads_blocks_nobody(pty: Pty, runner: asyncio.Runner):
    """Sixteen kilobytes into a pty that holds four: the write returns and the rest is known to be unsent."""

    async def scenario() -> None:
        protocol = Recorder()
        transport = await open_port(LinkParameters(device=pty.path), protocol)
        transport.write(b"x" * 16_384)
        assert transport.get_write_buffer_size() > 0
        transport.write(b"y")
        transport.abort()
        await protocol.lost
        transport.write(b"z")

    runner.run(scenario())


@pytest.mark.parametrize("hang_up", [True, False])
def test_hang_up_on_close_is_as_configured(pty: Pty, runner: asyncio.Runner, hang_up: bool):
    """The port's HUPCL flag says what the configuration says."""

    async def scenario() -> None:
        protocol = Recorder()
        transport = await open_port(LinkParameters(device=pty.path, hang_up_on_close=hang_up), protocol)
        descriptor = transport.get_extra_info("serial").fileno()
        assert bool(termios.tcgetattr(descriptor)[2] & termios.HUPCL) == hang_up
        transport.abort()
        await protocol.lost

    runner.run(scenario())


def test_a_second_opener_is_refused(pty: Pty, runner: asyncio.Runner):
    """With 'exclusive' there is one owner; the error names the device."""

    async def scenario() -> None:
        protocol = Recorder()
        transport = await open_port(LinkParameters(device=pty.path), protocol)
        with pytest.raises(OSError, match=pty.path):
            await open_port(LinkParameters(device=pty.path), Recorder())
        transport.abort()
        await protocol.lost

    runner.run(scenario())


def test_a_missing_device_is_an_error_that_names_it(runner: asyncio.Runner):
    """No such file: the message has the path, and what is there instead."""

    async def scenario() -> None:
        with pytest.raises(OSError, match=r"^/dev/no-such-board: there is no such device; .*serial port"):
            await open_port(LinkParameters(device="/dev/no-such-board"), Recorder())

    runner.run(scenario())


@pytest.mark.parametrize("device", ["loop://", "rfc2217://host:7", "spy:///dev/ttyACM0", "nonsense://board"])
def test_an_address_without_a_descriptor_is_refused(device: str):
    """There are more addresses than a loop can watch: the message names this one and says what is expected."""
    with pytest.raises(ValidationError, match=f"/dev/ttyACM0 or socket://host:port, got '{device}'"):
        LinkParameters(device=device)


def test_a_bad_address_of_a_socket_is_an_error_that_names_it(runner: asyncio.Runner):
    """At this port of the loopback nobody listens."""

    async def scenario() -> None:
        with pytest.raises(OSError, match=r"socket://127\.0\.0\.1:1: "):
            await open_port(LinkParameters(device="socket://127.0.0.1:1"), Recorder())

    runner.run(scenario())


@pytest.mark.parametrize("asserted", [True, False])
def test_dtr_and_rts_are_as_configured(pty: Pty, runner: asyncio.Runner, asserted: bool):
    """Both are handed to the port before it is opened, so that they never change while it is."""

    async def scenario() -> None:
        protocol = Recorder()
        parameters = LinkParameters(device=pty.path, dtr=asserted, rts=asserted)
        transport = await open_port(parameters, protocol)
        port = transport.get_extra_info("serial")
        assert (port.dtr, port.rts) == (asserted, asserted)
        transport.abort()
        await protocol.lost

    runner.run(scenario())


def test_a_socket_is_a_port_too(runner: asyncio.Runner):
    """``socket://host:port`` connects to a serial server and carries bytes both ways."""

    async def scenario() -> None:
        received = asyncio.get_running_loop().create_future()

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            received.set_result(await reader.readexactly(6))
            writer.write(b"u\t12\n")
            writer.close()

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        protocol = Recorder()
        transport = await open_port(LinkParameters(device=f"socket://127.0.0.1:{port}"), protocol)
        transport.write(b"s 1 2\r")
        assert await received == b"s 1 2\r"
        await protocol.data.wait()
        assert protocol.received == b"u\t12\n"
        await protocol.lost
        server.close()

    runner.run(scenario())


def test_settings_that_would_let_the_dead_man_come_while_driving_are_refused():
    """At 250 ms at least 16 commands a second, four in each dead-man; a classic board has none."""
    with pytest.raises(ValueError, match=r"setpoints_per_s 15 lets a dead-man of 250 ms come .* at least 16"):
        LinkParameters(setpoints_per_s=15)
    assert LinkParameters(setpoints_per_s=16).setpoints_per_s == 16
    assert LinkParameters(setpoints_per_s=5, firmware=FirmwareMode.CLASSIC).setpoints_per_s == 5
