"""Meeting the daemon: connect, hear its greeting, show a token, say a name."""

import asyncio
import ssl
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from chefbotd.client.errors import (
    CallTimeout,
    CannotConnect,
    ConnectionLost,
    IncompatibleProtocol,
    NoGreeting,
    ProtocolError,
)
from chefbotd.client.wire import Wire

PROTOCOL_MAJOR = "1"
CLOSING_PATIENCE_S = 1.0


@dataclass(frozen=True, slots=True)
class Hello:
    """The daemon's greeting; ``session`` changes when the daemon restarts."""

    protocol: str
    robot: str
    session: str
    link: Literal["up", "down"]
    auth: str
    capabilities: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Door:
    """Where the daemon listens, what we show it, and how long each step may take."""

    host: str
    port: int
    token: str | None = field(repr=False)
    tls: ssl.SSLContext | None
    name: str | None
    timeout_s: float


class Greeted:
    """A connection on which the greeting has been heard."""

    def __init__(self, wire: Wire, hello: Hello) -> None:
        self.wire, self.hello = wire, hello


async def meet(
    door: Door,
    on_notification: Callable[[str, dict[str, Any]], None],
    on_lost: Callable[[ConnectionLost], None],
) -> Greeted:
    """Connect and be let in; ``on_lost`` is told of the connection's end only after that.

    Raises:
        CannotConnect: nobody listens there, or it is not whom we trust.
        CallError: the daemon wants another token (``kind`` is ``wrong_token``).
        NoGreeting: the connection was closed, or stayed silent, before the greeting.
        ConnectionLost: the same, and it was said why.
        IncompatibleProtocol: the daemon speaks another major version.
    """
    greeting: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
    let_in = False

    def heard(method: str, params: dict[str, Any]) -> None:
        if method == "hello" and not greeting.done():
            greeting.set_result(params)
        on_notification(method, params)

    def lost(loss: ConnectionLost) -> None:
        if not greeting.done():
            greeting.set_exception(loss)
            greeting.exception()  # whoever waits is told; nobody may be left to
        if let_in:
            on_lost(loss)

    wire = Wire(heard, lost)
    await _connect(door, wire)
    try:
        hello = await _greeting(greeting, wire, door.timeout_s)
        if door.token is not None and hello.auth == "token":
            await wire.call("authenticate", {"token": door.token}, door.timeout_s)
        if door.name is not None:
            await wire.call("set_client_name", {"client": door.name}, door.timeout_s)
        if wire.lost is not None:
            raise ConnectionLost(str(wire.lost))
    except BaseException:
        await wire.close(CLOSING_PATIENCE_S)
        raise
    let_in = True
    return Greeted(wire, hello)


async def _connect(door: Door, wire: Wire) -> None:
    where = f"{door.host}:{door.port}"
    try:
        async with asyncio.timeout(door.timeout_s):
            await asyncio.get_running_loop().create_connection(
                lambda: wire, door.host, door.port, ssl=door.tls
            )
    except TimeoutError as error:
        raise CannotConnect(f"cannot connect to {where}: no answer within {door.timeout_s:g} s") from error
    except OSError as error:
        advice = "" if isinstance(error, ssl.SSLError) else "; is chefbotd running there?"
        raise CannotConnect(f"cannot connect to {where} ({error}){advice}") from error


async def _greeting(greeting: "asyncio.Future[dict[str, Any]]", wire: Wire, timeout_s: float) -> Hello:
    try:
        async with asyncio.timeout(timeout_s):
            params = await greeting
    except TimeoutError:
        raise NoGreeting(f"no greeting within {timeout_s:g} s") from None
    except ConnectionLost as loss:
        raise (ConnectionLost if wire.explained else NoGreeting)(str(loss)) from None
    protocol = str(params.get("protocol"))
    if protocol.partition(".")[0] != PROTOCOL_MAJOR:
        raise IncompatibleProtocol(f"the daemon speaks {protocol}, we {PROTOCOL_MAJOR}.x")
    try:
        told = {field.name: params[field.name] for field in fields(Hello)}  # a newer daemon may say more
        return Hello(**{**told, "capabilities": tuple(told["capabilities"])})
    except (KeyError, TypeError) as problem:
        raise ProtocolError(
            f"the daemon's greeting is not understood: {problem!r}, in {params!r:.200}"
        ) from problem


RECOVERABLE = (CannotConnect, ConnectionLost, CallTimeout)
"""What may be over when it is tried again."""
