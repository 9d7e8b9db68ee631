"""What clients do whom a token or a certificate keeps out, or who may only look."""

import contextlib
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace

from chefbotd.client import CallError, Client
from tests.scenarios.doors import by_token, by_token_and_tls
from tests.scenarios.faults.outcomes import DRIVES_ON, estopped
from tests.scenarios.faults.strangers import CUT_OFF, STOP, expect_end, last_kind, stranger
from tests.scenarios.trial import Fault, Trial


@asynccontextmanager
async def wrong_token(trial: Trial) -> AsyncIterator[None]:
    """Somebody says stop without being let in, and then shows a wrong token."""
    shown = b'{"jsonrpc":"2.0","id":2,"method":"authenticate","params":{"token":"' + b"w" * 32 + b'"}}\n'
    async with stranger(trial) as (reader, writer):
        writer.write(STOP + shown)
        yield
        await expect_end(trial, reader, "wrong_token")


@asynccontextmanager
async def no_token(trial: Trial) -> AsyncIterator[None]:
    """Somebody shows none."""
    async with stranger(trial) as (reader, _):
        yield
        await expect_end(trial, reader, "timed_out")


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
        trial.check(await last_kind(reader) is None, "is still connected")


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
SHORT = {"api.authenticate_s": 1.0}

FAULTS = (
    *(
        Fault(row, f"{name}, {guard}", inject, expected, door=door, overrides=SHORT)
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
            overrides=SHORT,
        )
        for name, inject in (("wrong token", wrong_token), ("no token in time", no_token))
    ),
    *(
        Fault("On a TLS port", name, inject, DRIVES_ON, door=by_token_and_tls, overrides=SHORT)
        for name, inject in (
            ("plain text on a TLS port", plain_text),
            ("TLS handshake that never comes", no_handshake),
            ("certificate that is not trusted", distrust),
        )
    ),
)
