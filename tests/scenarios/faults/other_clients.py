"""Misbehaving clients beside the driver: garbage, floods, slow bytes, too many connections, or unread data."""

import asyncio
import contextlib
import json
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

from benchmarks.abuse import SHAPES
from tests.scenarios.fault_run import Fault, FaultRun
from tests.scenarios.faults.outcomes import DRIVES_ON, SLACK_S, drives_on, estopped

Streams = tuple[asyncio.StreamReader, asyncio.StreamWriter]

BODY_BYTES = 1_000_000
CROWD = 200
DEAF = 10
CUT_OFF = drives_on("client_refused")
LISTEN_TO_ALL = (
    b'{"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"topics":["raw","wheels"],"policy":"ordered"}}\n'
)
DESCRIBE = b'{"jsonrpc":"2.0","id":1,"method":"describe"}\n'
PING = b'{"jsonrpc":"2.0","id":1,"method":"ping"}\n'
HOSTILE_NAME = (
    rb'{"jsonrpc":"2.0","id":1,"method":"set_client_name","params":{"client":"\u001b]0;a title\u0007"}}'
    + b"\n"
)
DRIVE_FROM_BEFORE = (
    b'{"jsonrpc":"2.0","id":1,"method":"drive",'
    b'"params":{"linear_m_s":0.3,"angular_rad_s":0.0,"if_stop_number":1}}\n'
)
STOP = b'{"jsonrpc":"2.0","id":1,"method":"stop"}\n'
ESTOP = b'{"jsonrpc":"2.0","id":1,"method":"estop"}\n'
BADLY_FORMED_ESTOP = b'{"method":"estop","id":[1],"colour":"red","params":{"reason":7,"again":NaN}}'


@asynccontextmanager
async def stranger(fault_run: FaultRun, holds_bytes: int | None = None) -> AsyncIterator[Streams]:
    """A connection that speaks what it likes; cut at the end, whatever it has left to say.

    ``holds_bytes``: the size of its kernel's receive buffer, which has to be set before it connects.
    """
    plain = socket.socket()
    plain.setblocking(False)
    if holds_bytes is not None:
        plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, holds_bytes)
    await asyncio.get_running_loop().sock_connect(plain, await fault_run.robot.daemon.server.address())
    reader, writer = await asyncio.open_connection(sock=plain)
    try:
        yield reader, writer
    finally:
        writer.transport.abort()


async def last_kind(reader: asyncio.StreamReader) -> str | None:
    """Read to the end of the connection, which must be near: the kind of the last error."""
    kind = None
    with contextlib.suppress(ConnectionError, TimeoutError):
        async with asyncio.timeout(0.1):
            while line := await reader.readline():
                kind = json.loads(line).get("error", {}).get("data", {}).get("kind", kind)
            return kind
    return kind or "still connected"


async def expect_end(fault_run: FaultRun, reader: asyncio.StreamReader, kind: str | None) -> None:
    """Note it if the connection has not ended, or ended as something else."""
    told = await last_kind(reader)
    fault_run.check(told == kind, f"cut off as {told}")


@asynccontextmanager
async def babble(shape: str, fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody sends a bad first message and a megabyte more."""
    first, body = SHAPES[shape]
    async with stranger(fault_run) as (_, writer):
        writer.write(first)
        with contextlib.suppress(ConnectionError):
            for _ in range(16):
                writer.write(body * (BODY_BYTES // 16 // len(body)))
                await writer.drain()
        yield


@asynccontextmanager
async def decided_before(fault_run: FaultRun) -> AsyncIterator[None]:
    """A program drives by what it decided before the last stop, or in another run of the daemon."""
    async with stranger(fault_run) as (reader, writer):
        writer.write(DRIVE_FROM_BEFORE)
        writer.write_eof()
        yield
        await expect_end(fault_run, reader, "stopped_since")


@asynccontextmanager
async def half_closed(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody sends half a request and no more."""
    async with stranger(fault_run) as (_, writer):
        writer.write(DESCRIBE[:20])
        writer.write_eof()
        yield


@asynccontextmanager
async def drip(fault_run: FaultRun) -> AsyncIterator[None]:
    """A request comes in byte by byte, slower than it may."""
    async with stranger(fault_run) as (reader, writer):
        for byte in DESCRIBE[:4]:
            writer.write(bytes([byte]))
            await asyncio.sleep(0.3)
        yield
        await expect_end(fault_run, reader, "timed_out")


@asynccontextmanager
async def idle(fault_run: FaultRun) -> AsyncIterator[None]:
    """A client is connected and asks for nothing; one that listens is not idle."""
    await fault_run.robot.client.call("subscribe", topics=["text"])
    async with stranger(fault_run) as (reader, _):
        yield
        await expect_end(fault_run, reader, "timed_out")


@asynccontextmanager
async def unread(fault_run: FaultRun) -> AsyncIterator[None]:
    """Ten clients ask for everything and read none of it."""
    async with contextlib.AsyncExitStack() as stack:
        for _ in range(DEAF):
            # Else some kernels hold megabytes for a client that reads nothing.
            _, writer = await stack.enter_async_context(stranger(fault_run, holds_bytes=8192))
            writer.transport.pause_reading()
            writer.write(LISTEN_TO_ALL + DESCRIBE * 200)
        yield
        left = (await fault_run.robot.client.call("get_stats"))["clients"] - 2
        fault_run.check(not left, f"{left} of them are still there")


@asynccontextmanager
async def crowd(fault_run: FaultRun) -> AsyncIterator[None]:
    """Two hundred connections at once, which is more than there is room for."""
    async with contextlib.AsyncExitStack() as stack:
        for _ in range(CROWD):
            await stack.enter_async_context(stranger(fault_run))
        yield


@asynccontextmanager
async def estop_in_a_crowd(fault_run: FaultRun) -> AsyncIterator[None]:
    """Where there is no room, somebody comes and presses stop in earnest."""
    async with crowd(fault_run), stranger(fault_run) as (_, writer):
        writer.write(ESTOP)
        await asyncio.sleep(0.01)
        yield


@asynccontextmanager
async def estop_of_who_waits(fault_run: FaultRun) -> AsyncIterator[None]:
    """Who has sent a request and waits since then presses stop in earnest, when a crowd has come."""
    async with stranger(fault_run) as (_, writer):
        writer.write(PING)
        await asyncio.sleep(0.01)
        async with crowd(fault_run):
            writer.write(ESTOP)
            await asyncio.sleep(0.01)
            yield


@asynccontextmanager
async def hostile_name(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody calls itself what a terminal would take for a command."""
    async with stranger(fault_run) as (reader, writer):
        writer.write(HOSTILE_NAME)
        await reader.readline()
        fault_run.check(b'"invalid_params"' in await reader.readline(), "its name was taken")
        yield


@asynccontextmanager
async def unread_estop(fault_run: FaultRun) -> AsyncIterator[None]:
    """A client that reads none of its answers presses stop in earnest, behind all that it has asked for."""
    async with stranger(fault_run) as (_, writer):
        writer.transport.pause_reading()
        writer.write(LISTEN_TO_ALL + DESCRIBE * 400)
        await asyncio.sleep(0.5)
        writer.write(DESCRIBE * 100 + ESTOP)
        yield


@asynccontextmanager
async def last_estop(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody presses stop in earnest behind a thousand requests, and the connection is reset at once."""
    async with stranger(fault_run) as (_, writer):
        writer.write(DESCRIBE * 1000 + ESTOP)
        await asyncio.sleep(0.001)
    yield


@asynccontextmanager
async def estop_in_a_flood(fault_run: FaultRun) -> AsyncIterator[None]:
    """A client that may ask for five things at once asks for ten, and then presses stop in earnest."""
    async with stranger(fault_run) as (_, writer):
        writer.write(DESCRIBE * 10 + ESTOP)
        yield


@asynccontextmanager
async def badly_formed_estop(fault_run: FaultRun) -> AsyncIterator[None]:
    """An estop with a wrong id, a wrong reason, more than is asked for and no end, and the connection is over."""
    async with stranger(fault_run) as (_, writer):
        writer.write(BADLY_FORMED_ESTOP)
        writer.write_eof()
        await asyncio.sleep(0.01)
        yield


def _row_of(shape: str) -> str:
    """What never ends its first line is too long, what ends every line is too many, all else is no JSON."""
    if shape.startswith(("endless", "open")):
        return "Request over 4 KiB"
    return (
        "Too many requests"
        if shape in ("valid requests", "line ends", "empty objects")
        else "HTTP, TLS, SSH, garbage"
    )


FLOOD = "Too many requests"
FEW_SLOTS = {"api.max_new_connections": 64}
UNREAD = "`stop` or `estop` of a client that does not read its answers"

FAULTS = (
    *(Fault(_row_of(shape), f"1 MB of {shape}", partial(babble, shape), CUT_OFF) for shape in SHAPES),
    Fault(
        "Too many requests",
        "estop among too many requests",
        estop_in_a_flood,
        estopped(),
        overrides={"api.requests_burst": 5},
    ),
    Fault("A program sends what it decided", "a drive from before the last stop", decided_before, DRIVES_ON),
    Fault("Request that arrives slowly", "half a request", half_closed, DRIVES_ON),
    Fault(
        "Request that arrives slowly",
        "request that drips in",
        drip,
        CUT_OFF,
        overrides={"api.request_timeout_s": 1.0},
    ),
    Fault(
        "Request that arrives slowly",
        "idle client",
        idle,
        CUT_OFF,
        lasts_s=4.0,
        overrides={"api.idle_timeout_s": 3.0},
    ),
    Fault("Client that reads nothing", "ten clients that read nothing", unread, CUT_OFF, lasts_s=7.0),
    Fault("Too many clients", "two hundred clients at once", crowd, CUT_OFF, overrides=FEW_SLOTS),
    Fault(
        "Too many clients",
        "estop where there is no room",
        estop_in_a_crowd,
        estopped(),
        overrides=FEW_SLOTS,
    ),
    Fault(
        "Too many clients",
        "estop of who waits beside a crowd",
        estop_of_who_waits,
        estopped(),
        overrides=FEW_SLOTS,
    ),
    Fault("Text of a client", "name that commands a terminal", hostile_name, DRIVES_ON),
    Fault("`stop` or `estop` in a bad form", "estop in a bad form", badly_formed_estop, estopped()),
    Fault(UNREAD, "estop of a client that reads nothing", unread_estop, estopped(1.2 + SLACK_S)),
    Fault(UNREAD, "estop as the last word of a connection", last_estop, estopped()),
)
