"""What clients do whom a token or a certificate keeps out, or who may only look."""

import contextlib
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace

from chefbotd.client import CallError, CannotConnect, Client
from tests.scenarios.access import by_token, by_token_and_tls
from tests.scenarios.fault_run import Fault, FaultRun
from tests.scenarios.faults.other_clients import CUT_OFF, STOP, expect_end, last_kind, stranger
from tests.scenarios.faults.outcomes import DRIVES_ON, estopped


@asynccontextmanager
async def wrong_token(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody says stop without being let in, and then shows a wrong token."""
    shown = b'{"jsonrpc":"2.0","id":2,"method":"authenticate","params":{"token":"' + b"w" * 32 + b'"}}\n'
    async with stranger(fault_run) as (reader, writer):
        writer.write(STOP + shown)
        yield
        await expect_end(fault_run, reader, "wrong_token")


@asynccontextmanager
async def no_token(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody shows none."""
    async with stranger(fault_run) as (reader, _):
        yield
        await expect_end(fault_run, reader, "timed_out")


@asynccontextmanager
async def observer_drives(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody who may only look wants to drive, to have control, and to arm."""
    async with fault_run.another("Oscar", "observe") as observer:
        for call in (observer.drive(-0.2, 0.0), observer.take_control(), observer.arm()):
            try:
                await call
            except CallError as refusal:
                fault_run.check(refusal.kind == "forbidden", f"refused as {refusal.kind}")
            else:
                fault_run.check(False, "an observer may do more than look")
        yield


@asynccontextmanager
async def observer_estops(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody who may only look presses stop in earnest."""
    async with fault_run.another("Oscar", "observe") as observer:
        await observer.estop("smoke")
        yield


@asynccontextmanager
async def plain_text(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody says stop on a TLS port without TLS."""
    async with stranger(fault_run) as (reader, writer):
        writer.write(STOP)
        yield
        with contextlib.suppress(ConnectionError):
            fault_run.check(b"jsonrpc" not in await reader.read(), "was answered in plain text")


@asynccontextmanager
async def no_handshake(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody connects to a TLS port and says nothing."""
    async with stranger(fault_run) as (reader, _):
        yield
        fault_run.check(await last_kind(reader) is None, "is still connected")


@asynccontextmanager
async def distrust(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody does not know the authority of the daemon's certificate, and keeps its token."""
    host, port = await fault_run.robot.daemon.server.address()
    key = replace(fault_run.access, tls=ssl.create_default_context()).key()
    try:
        async with Client.connect(host, port, **key):
            fault_run.check(False, "trusted a stranger")
    except CannotConnect as error:
        fault_run.check(isinstance(error.__cause__, ssl.SSLCertVerificationError), f"refused for {error}")
    yield


GUARDS = (("token", by_token), ("token and TLS", by_token_and_tls))
SHORT = {"api.authenticate_timeout_s": 1.0}

FAULTS = (
    *(
        Fault(row, f"{name}, {guard}", inject, expected, access=access, overrides=SHORT)
        for guard, access in GUARDS
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
            access=by_token,
            overrides=SHORT,
        )
        for name, inject in (("wrong token", wrong_token), ("no token in time", no_token))
    ),
    *(
        Fault("On a TLS port", name, inject, DRIVES_ON, access=by_token_and_tls, overrides=SHORT)
        for name, inject in (
            ("plain text on a TLS port", plain_text),
            ("TLS handshake that never comes", no_handshake),
            ("certificate that is not trusted", distrust),
        )
    ),
)
