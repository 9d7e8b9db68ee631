"""``chefbot-rosbridge``: a WebSocket that speaks rosbridge v2, for the robot of a daemon.

Each client gets a connection to the daemon of its own. So its role is that of the token which it shows, sources that it
took are its own, and what it drove with is withdrawn when it leaves.

The daemon sees all of them come from the bridge's computer. So where others than this computer can reach the bridge, it
holds to the daemon's own rule: nobody without a token, and nobody at all if the daemon asks for none.
"""

import argparse
import asyncio
import signal
from collections.abc import Callable, Coroutine
from contextlib import AbstractAsyncContextManager
from functools import partial
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import structlog
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Origin

from chefbot_ros2.rosbridge.protocol import Client, Hub
from chefbot_ros2.session import Session
from chefbotd import client as daemon
from chefbotd.client import ChefbotError
from chefbotd.rpc.parameters import is_loopback

log = structlog.get_logger("rosbridge")
ConnectAs = Callable[[str | None, str], AbstractAsyncContextManager[daemon.Client]]
"""Takes a token, and what the client is called."""

VERSION = "0.1.0"
PORT, MOST_CLIENTS, MOST_BYTES = 9090, 32, 1 << 16
POLICY_VIOLATION = 1008


class NotAdmitted(Exception):
    """This client is not served; the message says what it lacks."""


class Server:
    """One robot for all clients; the topics come by one connection to its daemon.

    With ``needs_tokens`` only clients are served that showed a token for which the daemon asked.
    """

    def __init__(
        self, connect_as: ConnectAs, token: str | None, source: str, *, needs_tokens: bool = False
    ) -> None:
        self._connect_as, self._source, self._clients = connect_as, source, 0
        self._needs_tokens = needs_tokens
        self._hub = Hub()
        self._session = Session(
            partial(connect_as, token, "rosbridge"),
            self._hub.publish,
            "rosbridge",
            VERSION,
            is_wanted=self._hub.is_wanted,
        )

    async def run(self, host: str, port: int, origins: list[str], listening: Callable[[int], None]) -> None:
        """Serve until cancelled. A page of another site is refused unless its origin is allowed."""
        async with serve(
            self._serve,
            host,
            port,
            origins=[None, *map(Origin, origins)],
            process_request=self._admit,
            max_size=MOST_BYTES,
            compression=None,
        ) as server:
            listening(next(iter(server.sockets)).getsockname()[1])
            await self._session.run()

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        if self._clients >= MOST_CLIENTS:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "too many clients\n")
        return None

    async def _serve(self, socket: ServerConnection) -> None:
        self._clients += 1
        host, port, *_ = socket.remote_address
        token = token_of(socket.request)
        try:
            if self._needs_tokens and token is None:
                raise NotAdmitted("show a token: Authorization: Bearer TOKEN, or ?token=TOKEN")
            async with self._connect_as(token, f"rosbridge {host}:{port}") as robot:
                if self._needs_tokens and robot.hello.auth != "token":
                    raise NotAdmitted("the daemon asks for no tokens, so only its own computer is served")
                await self._converse(socket, robot)
        except* ConnectionClosed:
            pass
        except* (NotAdmitted, ChefbotError, OSError, TimeoutError) as problems:
            reason = str(problems.exceptions[0])
            log.warning("a client of rosbridge is sent away", client=f"{host}:{port}", why=reason)
            await socket.close(POLICY_VIOLATION, reason.encode()[:120].decode(errors="ignore"))
        finally:
            self._clients -= 1

    async def _converse(self, socket: ServerConnection, robot: daemon.Client) -> None:
        """Until the client leaves; each thing it asks is done before the next is read."""
        client = Client(self._hub, self._source)
        self._hub.add(client)
        try:
            async with client.commands.serving(robot), asyncio.TaskGroup() as tasks:
                sending = tasks.create_task(_send(socket, client))
                async for text in socket:
                    client.commands.stop_number = self._session.stop_number
                    await client.handle(text)
                sending.cancel()
        finally:
            self._hub.remove(client)


async def _send(socket: ServerConnection, client: Client) -> None:
    while True:
        for text in await client.next_texts():
            await socket.send(text)


def token_of(request: Request | None) -> str | None:
    """``Authorization: Bearer TOKEN``; of a browser, which cannot send that, ``?token=TOKEN``."""
    if request is None:
        return None
    scheme, _, token = request.headers.get("Authorization", "").partition(" ")
    if scheme.lower() == "bearer" and token:
        return token
    tokens = parse_qs(urlsplit(request.path).query).get("token", [])
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
    options = parser.parse_args()
    host, _, port = options.connect.rpartition(":")
    words = options.token_file.read_text().split() if options.token_file else [None]
    if not words:
        parser.error(f"{options.token_file} is empty: expected a token")
    is_open = not is_loopback(options.host)
    if is_open and words[-1] is None:
        parser.error("beyond this computer the bridge needs the daemon's tokens: --token-file")

    def connect_as(token: str | None, name: str) -> AbstractAsyncContextManager[daemon.Client]:
        return daemon.Client.connect(host, int(port), token=token, name=name)

    server = Server(connect_as, words[-1], options.source, needs_tokens=is_open)

    def listening(at: int) -> None:
        log.info("rosbridge listens", url=f"ws://{options.host}:{at}")

    asyncio.run(_until_signalled(server.run(options.host, options.port, options.origin, listening)))


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
