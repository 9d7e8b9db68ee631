"""Opens a connection to the daemon: connects, waits for the greeting, authenticates, sets the client's name."""

import asyncio
import ipaddress
import ssl
from collections.abc import Callable
from typing import Any, Literal

from msgspec.structs import fields

from chefbotd.client.errors import (
    CallTimeout,
    CannotConnect,
    ConnectionLost,
    IncompatibleProtocol,
    NoGreeting,
    ProtocolError,
    TokenWithheld,
)
from chefbotd.client.wire import Wire
from chefbotd.core.record import Record

PROTOCOL_MAJOR = "1"
CLOSING_PATIENCE_S = 1.0


class DaemonGreeting(Record, frozen=True):
    """The daemon's greeting; ``session`` changes when the daemon restarts.

    A command to move is obeyed for ``command_timeout_s``, which an older daemon does not tell: ChefBot's, then.

    Not ``rpc.models.Greeting``: a stop does not wait until the models are loaded.
    """

    protocol: str
    robot: str
    session: str
    link: Literal["up", "down"]
    auth: str
    capabilities: tuple[str, ...]
    command_timeout_s: float = 0.5


class Endpoint(Record, frozen=True):
    """Where the daemon listens, the credentials and name to present, and the time limit of each step in seconds.

    ``clear_token`` says whether the token may go to another computer without TLS; None: it goes, and is warned of.
    """

    host: str
    port: int
    token: str | None
    tls: ssl.SSLContext | None
    name: str | None
    timeout_s: float
    clear_token: bool | None = None

    def __repr__(self) -> str:
        """Without the token."""
        return f"Endpoint({self.host!r}, {self.port}, name={self.name!r})"


class GreetedConnection:
    """An open connection and the greeting received on it."""

    def __init__(self, wire: Wire, hello: DaemonGreeting) -> None:
        self.wire, self.hello = wire, hello


async def open_connection(
    endpoint: Endpoint,
    on_notification: Callable[[str, dict[str, Any]], None],
    on_lost: Callable[[ConnectionLost], None],
) -> GreetedConnection:
    """Connect, authenticate and set the name. ``on_lost`` is called only for a loss after that.

    Raises:
        CannotConnect: nobody listens there, or the certificate is not trusted.
        CallError: the daemon refuses the token (``kind`` is ``wrong_token``).
        NoGreeting: the connection was closed, or stayed silent, before the greeting.
        ConnectionLost: the daemon closed the connection and said why.
        IncompatibleProtocol: the daemon speaks another major version.
        TokenWithheld: the connection is not encrypted, and ``clear_token`` is False.
    """
    greeting: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
    is_admitted = False

    def on_message(method: str, params: dict[str, Any]) -> None:
        if method == "hello" and not greeting.done():
            greeting.set_result(params)
        on_notification(method, params)

    def lost(loss: ConnectionLost) -> None:
        if not greeting.done():
            greeting.set_exception(loss)
            greeting.exception()  # mark it as retrieved: nobody may be waiting any more
        if is_admitted:
            on_lost(loss)

    wire = Wire(on_message, lost)
    await _connect(endpoint, wire)
    try:
        hello = await _greeting(greeting, wire, endpoint.timeout_s)
        if endpoint.token is not None and hello.auth == "token":
            _check_way(endpoint, wire.peer_host)
            await wire.call("authenticate", {"token": endpoint.token}, endpoint.timeout_s)
        if endpoint.name is not None:
            await wire.call("set_client_name", {"client": endpoint.name}, endpoint.timeout_s)
        elif endpoint.token is None:
            wire.notify("ping", {})  # who has said nothing gives way to others
        if wire.lost is not None:
            raise ConnectionLost(str(wire.lost))
    except BaseException:
        await wire.close(CLOSING_PATIENCE_S)
        raise
    is_admitted = True
    return GreetedConnection(wire, hello)


def _check_way(endpoint: Endpoint, peer_host: str) -> None:
    """Whoever greets asks for a token: only a certificate tells who that is, and TLS keeps others from reading it."""
    if endpoint.tls is not None or endpoint.clear_token or is_this_computer(peer_host):
        return
    why = f"the connection to {endpoint.host} is not encrypted: others can read the token, or ask for it"
    if endpoint.clear_token is None:
        import structlog  # not in the memory of who never needs it

        structlog.get_logger(__name__).warning(
            "token_in_clear", why=why, hint="pass tls=ssl.create_default_context(cafile=CERTIFICATE)"
        )
        return
    raise TokenWithheld(
        f"{why}, so it was not sent; --ca names the daemon's certificate (its api.tls_certificate), and --clear-token "
        "sends it all the same"
    )


def is_this_computer(address: str) -> bool:
    """Whether an address is of the loopback interface, which nobody else can listen to."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return False
    mapped = getattr(parsed, "ipv4_mapped", None)
    return bool((mapped or parsed).is_loopback)


async def _connect(endpoint: Endpoint, wire: Wire) -> None:
    where = f"{endpoint.host}:{endpoint.port}"
    try:
        async with asyncio.timeout(endpoint.timeout_s):
            await asyncio.get_running_loop().create_connection(
                lambda: wire, endpoint.host, endpoint.port, ssl=endpoint.tls
            )
    except TimeoutError as error:
        raise CannotConnect(
            f"cannot connect to {where}: no answer within {endpoint.timeout_s:g} s"
        ) from error
    except OSError as error:
        advice = "" if isinstance(error, ssl.SSLError) else "; is chefbotd running there?"
        raise CannotConnect(f"cannot connect to {where} ({error}){advice}") from error


async def _greeting(
    greeting: "asyncio.Future[dict[str, Any]]", wire: Wire, timeout_s: float
) -> DaemonGreeting:
    try:
        async with asyncio.timeout(timeout_s):
            params = await greeting
    except TimeoutError:
        raise NoGreeting(f"no greeting within {timeout_s:g} s") from None
    except ConnectionLost as loss:
        raise (ConnectionLost if wire.has_reason else NoGreeting)(str(loss)) from None
    protocol = str(params.get("protocol"))
    if protocol.partition(".")[0] != PROTOCOL_MAJOR:
        raise IncompatibleProtocol(
            f"the daemon speaks protocol {protocol}, and this client {PROTOCOL_MAJOR}.x"
        )
    try:
        known_fields = {
            field.name: params[field.name]
            for field in fields(DaemonGreeting)
            if field.required or field.name in params
        }  # a newer daemon may say more
        return DaemonGreeting(**{**known_fields, "capabilities": tuple(known_fields["capabilities"])})
    except (KeyError, TypeError) as problem:
        raise ProtocolError(
            f"the daemon's greeting is not understood: {problem!r}, in {params!r:.200}"
        ) from problem


RECOVERABLE = (CannotConnect, ConnectionLost, CallTimeout)
"""Errors after which another attempt to connect may succeed."""
