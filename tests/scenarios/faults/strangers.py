"""What other clients do while one drives: babble, flood, drip, crowd in, read nothing, or want what is not theirs."""

import asyncio
import contextlib
import json
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from functools import partial

from benchmarks.abuse import SHAPES
from chefbotd.client import CallError, Client
from tests.scenarios.doors import by_token, by_token_and_tls
from tests.scenarios.faults.outcomes import DRIVES_ON, drives_on, estopped
from tests.scenarios.trial import Fault, Trial

Streams = tuple[asyncio.StreamReader, asyncio.StreamWriter]

BODY_BYTES = 1_000_000
CROWD = 200
DEAF = 10
CUT_OFF = drives_on("client_refused")
LISTEN_TO_ALL = (
    b'{"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"topics":["raw","wheels"],"policy":"ordered"}}\n'
)
DESCRIBE = b'{"jsonrpc":"2.0","id":1,"method":"describe"}\n'
STOP = b'{"jsonrpc":"2.0","id":1,"method":"stop"}\n'
BADLY_FORMED_ESTOP = b'{"method":"estop","id":[1],"colour":"red","params":{"reason":7,"again":NaN}}'


@asynccontextmanager
async def stranger(trial: Trial) -> AsyncIterator[Streams]:
    """A connection that speaks what it likes; cut at the end, whatever it has left to say."""
    host, port = await trial.robot.daemon.server.address()
    reader, writer = await asyncio.open_connection(host, port)
    try:
        yield reader, writer
    finally:
        writer.transport.abort()


async def _last_kind(reader: asyncio.StreamReader) -> str | None:
    """Read to the end of the connection, which must be near: the kind of the last error."""
    kind = None
    with contextlib.suppress(ConnectionError, TimeoutError):
        async with asyncio.timeout(0.1):
            while line := await reader.readline():
                kind = json.loads(line).get("error", {}).get("data", {}).get("kind", kind)
            return kind
    return kind or "still connected"


async def _expect_end(trial: Trial, reader: asyncio.StreamReader, kind: str | None) -> None:
    told = await _last_kind(reader)
    trial.check(told == kind, f"cut off as {told}")


@asynccontextmanager
async def babble(shape: str, trial: Trial) -> AsyncIterator[None]:
    """Somebody sends a bad first message and a megabyte more."""
    first, body = SHAPES[shape]
    async with stranger(trial) as (_, writer):
        writer.write(first)
        with contextlib.suppress(ConnectionError):
            for _ in range(16):
                writer.write(body * (BODY_BYTES // 16 // len(body)))
                await writer.drain()
        yield


@asynccontextmanager
async def half_closed(trial: Trial) -> AsyncIterator[None]:
    """Somebody sends half a request and no more."""
    async with stranger(trial) as (_, writer):
        writer.write(DESCRIBE[:20])
        writer.write_eof()
        yield


@asynccontextmanager
async def drip(trial: Trial) -> AsyncIterator[None]:
    """A request comes in byte by byte, slower than it may."""
    async with stranger(trial) as (reader, writer):
        for byte in DESCRIBE[:4]:
            writer.write(bytes([byte]))
            await asyncio.sleep(0.3)
        yield
        await _expect_end(trial, reader, "timed_out")


@asynccontextmanager
async def idle(trial: Trial) -> AsyncIterator[None]:
    """A client is connected and asks for nothing; one that listens is not idle."""
    await trial.robot.client.call("subscribe", topics=["text"])
    async with stranger(trial) as (reader, _):
        yield
        await _expect_end(trial, reader, "timed_out")


@asynccontextmanager
async def unread(trial: Trial) -> AsyncIterator[None]:
    """Ten clients ask for everything and read none of it."""
    async with contextlib.AsyncExitStack() as stack:
        for _ in range(DEAF):
            _, writer = await stack.enter_async_context(stranger(trial))
            writer.transport.pause_reading()
            writer.write(LISTEN_TO_ALL + DESCRIBE * 200)
        yield
        left = (await trial.robot.client.get_stats())["clients"] - 2
        trial.check(not left, f"{left} of them are still there")


@asynccontextmanager
async def crowd(trial: Trial) -> AsyncIterator[None]:
    """Two hundred connections at once, which is more than there is room for."""
    async with contextlib.AsyncExitStack() as stack:
        for _ in range(CROWD):
            await stack.enter_async_context(stranger(trial))
        yield


@asynccontextmanager
async def estop_in_a_crowd(trial: Trial) -> AsyncIterator[None]:
    """Where there is no room, somebody comes and presses stop in earnest."""
    async with crowd(trial), stranger(trial) as (_, writer):
        writer.write(b'{"jsonrpc":"2.0","id":1,"method":"estop"}\n')
        await asyncio.sleep(0.01)
        yield


@asynccontextmanager
async def badly_formed_estop(trial: Trial) -> AsyncIterator[None]:
    """An estop with a wrong id, a wrong reason, more than is asked for and no end, and the connection is over."""
    async with stranger(trial) as (_, writer):
        writer.write(BADLY_FORMED_ESTOP)
        writer.write_eof()
        await asyncio.sleep(0.01)
        yield


@asynccontextmanager
async def wrong_token(trial: Trial) -> AsyncIterator[None]:
    """Somebody says stop without being let in, and then shows a wrong token."""
    shown = b'{"jsonrpc":"2.0","id":2,"method":"authenticate","params":{"token":"' + b"w" * 32 + b'"}}\n'
    async with stranger(trial) as (reader, writer):
        writer.write(STOP + shown)
        yield
        await _expect_end(trial, reader, "wrong_token")


@asynccontextmanager
async def no_token(trial: Trial) -> AsyncIterator[None]:
    """Somebody shows none."""
    async with stranger(trial) as (reader, _):
        yield
        await _expect_end(trial, reader, "timed_out")


@asynccontextmanager
async def observer_drives(trial: Trial) -> AsyncIterator[None]:
    """Somebody who may only look wants to drive, to have control, and to arm."""
    async with trial.another("Oscar", "observe") as observer:
        for call in (observer.drive(-0.2, 0.0), observer.take_control(), observer.arm()):
            try:
                await call
            except CallError as refusal:
                trial.check(refusal.kind == "forbidden", f"refused as {refusal.kind}")
            else:
                trial.check(False, "an observer may do more than look")
        yield


@asynccontextmanager
async def observer_estops(trial: Trial) -> AsyncIterator[None]:
    """Somebody who may only look presses stop in earnest."""
    async with trial.another("Oscar", "observe") as observer:
        await observer.estop("smoke")
        yield


@asynccontextmanager
async def plain_text(trial: Trial) -> AsyncIterator[None]:
    """Somebody says stop on a TLS port without TLS."""
    async with stranger(trial) as (reader, writer):
        writer.write(STOP)
        yield
        with contextlib.suppress(ConnectionError):
            trial.check(b"jsonrpc" not in await reader.read(), "was answered in plain text")


@asynccontextmanager
async def no_handshake(trial: Trial) -> AsyncIterator[None]:
    """Somebody connects to a TLS port and says nothing."""
    async with stranger(trial) as (reader, _):
        yield
        trial.check(await _last_kind(reader) is None, "is still connected")


@asynccontextmanager
async def distrust(trial: Trial) -> AsyncIterator[None]:
    """Somebody does not know the authority of the daemon's certificate, and keeps its token."""
    host, port = await trial.robot.daemon.server.address()
    key = replace(trial.door, tls=ssl.create_default_context()).key()
    try:
        async with Client.connect(host, port, **key):
            trial.check(False, "trusted a stranger")
    except ssl.SSLCertVerificationError:
        pass
    yield


GUARDS = (("token", by_token), ("token and TLS", by_token_and_tls))
TLS_PORT = "On a TLS port"

FAULTS = (
    *(
        Fault("HTTP, TLS, SSH, garbage", f"1 MB of {shape}", partial(babble, shape), CUT_OFF)
        for shape in SHAPES
    ),
    Fault("Request that drips in", "half a request", half_closed, DRIVES_ON),
    Fault("Request that drips in", "request that drips in", drip, CUT_OFF, overrides={"api.request_s": 1.0}),
    Fault("Request that drips in", "idle client", idle, CUT_OFF, lasts_s=4.0, overrides={"api.idle_s": 3.0}),
    Fault("Client that reads nothing", "ten clients that read nothing", unread, CUT_OFF, lasts_s=7.0),
    Fault("Too many clients", "two hundred clients at once", crowd, CUT_OFF),
    Fault("Too many clients", "estop where there is no room", estop_in_a_crowd, estopped()),
    Fault("`stop` or `estop` in a bad form", "estop in a bad form", badly_formed_estop, estopped()),
    *(
        Fault(row, f"{name}, {guard}", inject, expected, door=door, overrides={"api.authenticate_s": 1.0})
        for guard, door in GUARDS
        for row, name, inject, expected in (
            ("Role too low", "observer drives", observer_drives, DRIVES_ON),
            ("`estop`", "observer presses estop", observer_estops, estopped()),
        )
    ),
    *(
        Fault(
            "Wrong token, or none in time",
            name,
            inject,
            CUT_OFF,
            door=by_token,
            overrides={"api.authenticate_s": 1.0},
        )
        for name, inject in (("wrong token", wrong_token), ("no token in time", no_token))
    ),
    *(
        Fault(TLS_PORT, name, inject, DRIVES_ON, door=by_token_and_tls, overrides={"api.authenticate_s": 1.0})
        for name, inject in (
            ("plain text on a TLS port", plain_text),
            ("TLS handshake that never comes", no_handshake),
            ("certificate that is not trusted", distrust),
        )
    ),
)
