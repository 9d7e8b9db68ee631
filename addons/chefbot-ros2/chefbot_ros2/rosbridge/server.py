"""``chefbot-rosbridge``: a WebSocket that speaks rosbridge v2, for the robot of a daemon.

Each client gets a connection to the daemon of its own. So its role is that of the token which it shows, sources that it
took are its own, and what it drove with is withdrawn when it leaves.

The daemon sees all of them come from the bridge's computer. So where others than this computer can reach the bridge, it
holds to the daemon's own rule: nobody without a token, and nobody at all if the daemon asks for none.
"""

import argparse
import asyncio
import gc
import signal
import ssl
from collections.abc import Callable, Coroutine
from contextlib import AbstractAsyncContextManager
from functools import partial
from http import HTTPStatus
from pathlib import Path
from typing import Any, cast
from urllib.parse import parse_qs, urlsplit

import structlog
from aiohttp import web

from chefbot_ros2.rosbridge.dispatcher import LONGEST_BYTES, UNKNOWN, RosbridgeDispatcher, RosbridgeFraming
from chefbot_ros2.rosbridge.protocol import Client, Hub
from chefbot_ros2.session import Session as Robot
from chefbotd import client as daemon
from chefbotd.client import ChefbotError
from chefbotd.client.access import CA_HELP, CLEAR_TOKEN_HELP, daemon_access
from chefbotd.client.models import SafetyData
from chefbotd.clock import SystemClock
from chefbotd.core.record import replace
from chefbotd.process.watchdog import raise_priority
from chefbotd.rpc.arrivals import SHORT_TICK_S, Arrivals
from chefbotd.rpc.connection_manager import ConnectionManager
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.jsonrpc import ErrorKind, Failure
from chefbotd.rpc.method import Receiver
from chefbotd.rpc.parameters import ApiParameters, Role, is_loopback
from chefbotd.rpc.session import Session
from chefbotd.transport.unread import UnreadSockets
from chefbotd.transport.web.http_server import ADD_ON_LIMITS, HttpServer, plain_answer
from chefbotd.transport.web.websocket import WebSocketConnection, is_websocket, switch, turn_away

log = structlog.get_logger("rosbridge")
ConnectAs = Callable[[str | None, str], AbstractAsyncContextManager[daemon.Client]]
"""Takes a token, and what the client is called."""

VERSION = "0.1.0"
PORT = 9090
NO_STOP_KNOWN = -1
"""No stop of the robot's has this number."""

POLICY_VIOLATION = 1008
PARAMETERS = ApiParameters(
    max_clients=32,
    max_clients_per_address=28,
    reserved_stop_connections=4,
    max_request_bytes=LONGEST_BYTES,
    backlog_bytes=LONGEST_BYTES,
    requests_per_s=500.0,
    requests_burst=500,
    write_timeout_s=30.0,
)
"""The daemon's limits, with fewer clients and messages: each is a connection to the daemon, and longer work."""


RECEIVE_BYTES = 8192
"""What the kernel holds of a client, and so what is read of it in one turn of the loop: at most twice this."""


class NotAdmitted(Exception):
    """This client is not served; the message says what it lacks."""


class Subscribers:
    """Which connections take a topic."""

    def __init__(self) -> None:
        self._clients: dict[Receiver, Client] = {}

    def add(self, receiver: Receiver, client: Client) -> None:
        """A client has come."""
        self._clients[receiver] = client

    def is_subscribed(self, receiver: Receiver) -> bool:
        """Whether a receiver takes any topic."""
        client = self._clients.get(receiver)
        return client is not None and client.is_subscribed

    def remove_receiver(self, receiver: Receiver) -> None:
        """A client has gone."""
        self._clients.pop(receiver, None)


class Server:
    """One robot for all clients; the topics come by one connection to its daemon.

    With ``needs_tokens`` only clients are served that showed a token for which the daemon asked.
    """

    def __init__(
        self,
        connect_as: ConnectAs,
        token: str | None,
        source: str,
        *,
        needs_tokens: bool = False,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self._connect_as, self._source, self._needs_tokens = connect_as, source, needs_tokens
        self._hub, self._origins = Hub(), set[str]()
        self._clock, self._stop_number = SystemClock(), NO_STOP_KNOWN
        self._arrivals, self._unread = Arrivals(self._clock), UnreadSockets()
        self._arrivals.add_transport(self._unread.mark)
        self._dispatcher = RosbridgeDispatcher(self._clock, self._arrivals, lambda: self._robot.stop_number)
        self._subscribers = Subscribers()
        self._manager = ConnectionManager(
            PARAMETERS,
            self._clock,
            self._dispatcher,
            self._arrivals,
            self._subscribers,
            ControlLeases(PARAMETERS.lease_s, 0.0, lambda source: None, lambda change: None),
            greeting=lambda: b"",
            role=None,
            announce_left=lambda client: None,
        )
        self._http = HttpServer(
            self._serve, "rosbridge", tls, replace(ADD_ON_LIMITS, receive_bytes=RECEIVE_BYTES)
        )
        self._robot = Robot(
            partial(connect_as, token, "rosbridge"),
            self._hub.publish,
            "rosbridge",
            VERSION,
            is_wanted=self._hub.is_wanted,
            on_safety=self._take_safety,
        )

    async def run(self, host: str, port: int, origins: list[str], listening: Callable[[int], None]) -> None:
        """Serve until cancelled. A page of another site is refused unless its origin is allowed."""
        self._origins = {origin.lower() for origin in origins}
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._http.run(host, port, lambda _, port: listening(port)))
            tasks.create_task(self._robot.run())
            tasks.create_task(self._tick())

    async def _tick(self) -> None:
        while True:
            self._arrivals.tick()
            self._manager.sweep()
            await asyncio.sleep(SHORT_TICK_S)

    def _take_safety(self, safety: SafetyData) -> None:
        """Whoever stopped the robot: what has been sent before that moves nothing any more.

        Nor does what was sent before anything was known of the robot's stops.
        """
        if safety.stop_number != self._stop_number:
            is_first, self._stop_number = self._stop_number == NO_STOP_KNOWN, safety.stop_number
            self._arrivals.record_stop(None, UNKNOWN if is_first else safety.reason or "somebody")

    async def _serve(self, request: web.BaseRequest) -> web.StreamResponse:
        origin = request.headers.get("Origin")
        if origin is not None and origin.lower() not in self._origins:
            return plain_answer(HTTPStatus.FORBIDDEN, "pages of this origin may not connect: see --origin")
        if not is_websocket(request):
            return plain_answer(HTTPStatus.UPGRADE_REQUIRED, "this is a WebSocket of version 13")
        host, port = request.transport.get_extra_info("peername")[:2] if request.transport else ("", 0)
        name, token, reason = f"rosbridge {host}:{port}", token_of(request), ""
        try:
            if self._needs_tokens and token is None:
                raise NotAdmitted("show a token: Authorization: Bearer TOKEN, or ?token=TOKEN")
            async with self._connect_as(token, name) as robot:
                if self._needs_tokens and robot.hello.auth != "token":
                    raise NotAdmitted("the daemon asks for no tokens, so only its own computer is served")
                admitted = self._manager.admit(host, port)
                if isinstance(admitted, Failure):
                    raise NotAdmitted(admitted.message)
                self._http.show_proof(request)
                admitted.show_token(Role.OBSERVE, None)  # what it may do is what the daemon says to its token
                await self._converse(request, admitted, robot)
        except* (NotAdmitted, ChefbotError, OSError, TimeoutError) as problems:
            reason = str(first_of(problems))
        if reason:
            self._http.count_refused(host, "sent away", reason)
            return turn_away(request, POLICY_VIOLATION, reason)
        return web.Response()

    async def _converse(self, request: web.BaseRequest, session: Session, robot: daemon.Client) -> None:
        """Until the client or the daemon leaves; a stop that had arrived is carried out to its end."""
        connection = WebSocketConnection(
            self._manager,
            self._unread,
            session,
            self._http.plain_socket(request),
            cast(asyncio.Protocol, request.protocol),
            RosbridgeFraming(),
        )
        client = Client(self._hub, self._source, connection, self._clock.now_s)
        self._dispatcher.add(session, client)
        self._subscribers.add(connection, client)
        self._hub.add(client)
        try:
            async with client.commands.serving(robot):
                switch(request, connection)
                await connection.gone.wait()
                self._hub.remove(client)
                await connection.over.wait()
                await client.finish_stops()
        except* ChefbotError as problems:
            connection.end(Failure(ErrorKind.INTERNAL, str(first_of(problems))))
            await connection.gone.wait()
        finally:
            self._hub.remove(client)
            self._dispatcher.remove(session)
            if not connection.gone.is_set():
                self._manager.remove(session)


def first_of(problems: BaseExceptionGroup[Any]) -> BaseException:
    """The first problem of a group of groups."""
    first = problems.exceptions[0]
    return first_of(first) if isinstance(first, BaseExceptionGroup) else first


def token_of(request: web.BaseRequest) -> str | None:
    """``Authorization: Bearer TOKEN``; of a browser, which cannot send that, ``?token=TOKEN``."""
    scheme, _, token = request.headers.get("Authorization", "").partition(" ")
    if scheme.lower() == "bearer" and token:
        return token
    tokens = parse_qs(urlsplit(request.raw_path).query).get("token", [])
    return tokens[0] if tokens else None


def main() -> None:
    """Run the server until SIGINT or SIGTERM."""
    parser = argparse.ArgumentParser(prog="chefbot-rosbridge", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--connect", metavar="HOST:PORT", default="127.0.0.1:7333", help="the daemon's socket"
    )
    parser.add_argument(
        "--token-file", type=Path, help="a file with a token of the role agent, for the topics"
    )
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on; loopback by default")
    parser.add_argument("--port", type=int, default=PORT, help="0 lets the system choose")
    parser.add_argument(
        "--origin", action="append", default=[], help="whose pages may connect: http://HOST:PORT"
    )
    parser.add_argument(
        "--source", default="ros2", help="the source of velocities in the daemon's [safety.sources]"
    )
    parser.add_argument("--ca", type=Path, help=CA_HELP)
    parser.add_argument("--clear-token", action="store_true", help=CLEAR_TOKEN_HELP)
    parser.add_argument("--certificate", type=Path, help="the bridge's own (PEM): it speaks wss://")
    parser.add_argument("--key", type=Path, help="its key (PEM), where that is in another file")
    options = parser.parse_args()
    host, _, port = options.connect.rpartition(":")
    try:
        access = daemon_access(
            host, int(port), options.token_file, options.ca, clear_token=options.clear_token
        )
        tls = certified(options.certificate, options.key)
    except ValueError as error:
        parser.error(str(error))
    is_open = not is_loopback(options.host)
    if is_open and access.token is None:
        parser.error("beyond this computer the bridge needs the daemon's tokens: --token-file")
    if is_open and tls is None:
        log.warning("rosbridge_not_encrypted", hint="--certificate and --key: tokens can be overheard")
    server = Server(access.connect_as, access.token, options.source, needs_tokens=is_open, tls=tls)

    def listening(at: int) -> None:
        log.info("rosbridge listens", url=f"{'ws' if tls is None else 'wss'}://{options.host}:{at}")

    gc.collect()
    gc.freeze()  # no collection looks at all these classes: it would keep a stop waiting
    raise_priority(0, lock_memory=False)  # nor do other programs, where the computer allows it
    asyncio.run(_until_signalled(server.run(options.host, options.port, options.origin, listening)))


def certified(certificate: Path | None, key: Path | None) -> ssl.SSLContext | None:
    """What shows this certificate; None: nothing is encrypted. Raises ``ValueError``."""
    if certificate is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, key)
    except (OSError, ssl.SSLError) as error:
        raise ValueError(f"{certificate}: no certificate with its key: {error}") from error
    return context


async def _until_signalled(work: Coroutine[Any, Any, None]) -> None:
    task, loop = asyncio.ensure_future(work), asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, task.cancel)
    try:
        await task
    except asyncio.CancelledError:
        return


if __name__ == "__main__":
    main()
