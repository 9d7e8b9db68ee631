"""The page with the button to talk: its files, and a WebSocket for what is pressed and said.

It listens on a port of its own, so what people say goes to this program alone, and not through the daemon, whose topics
anybody may read. Who may talk is who may send the robot to goals: the token is shown to the daemon.
"""

import contextlib
import json
import ssl
from collections.abc import Awaitable, Callable, Collection
from http import HTTPStatus
from importlib import resources
from typing import Any, Final, Protocol

import structlog
from aiohttp import WSMsgType, web

from chefbotd.transport.web import STOPS_SCRIPT
from chefbotd.transport.web.http_server import ADD_ON_LIMITS, HttpServer
from chefbotd.transport.web.origin import is_own_host, is_own_origin
from chefbotd.transport.web.server import HEADERS, TYPES

log = structlog.get_logger("speech")
MOST_TALKERS: Final = 8
MOST_MESSAGE_BYTES: Final = 64 * 1024
HEARTBEAT_S: Final = 5.0
"""A page that does not answer for this time is gone; what it proposed is forgotten."""

GREETING_S: Final = 5.0
Send = Callable[[dict[str, Any]], Awaitable[None]]


class Talker(Protocol):
    """One page."""

    async def take(self, message: dict[str, Any]) -> None:
        """Something was pressed."""
        ...

    def add_sound(self, data: bytes) -> None:
        """A piece of what was said."""
        ...

    async def leave(self) -> None:
        """The page is gone."""
        ...


class NotAdmitted(Exception):
    """The token is missing or wrong, or its role may not send the robot anywhere; the message is for people."""


Admit = Callable[[str | None, Send], Awaitable[Talker]]
"""Make a talker of a page with this token; raises ``NotAdmitted``."""


def files() -> dict[str, tuple[str, bytes]]:
    """The page's files by path, each with its type."""
    folder = resources.files(__package__) / "page"
    found = {
        f"/{entry.name}": (TYPES[entry.name.rpartition(".")[2]], entry.read_bytes())
        for entry in folder.iterdir()
    }
    stops = (TYPES["js"], STOPS_SCRIPT.read_bytes())
    return {"/": found["/index.html"], **found, f"/{STOPS_SCRIPT.name}": stops}


class PageServer:
    """``admit`` decides who may talk; ``names`` are host names of this computer, beside its addresses."""

    def __init__(self, admit: Admit, tls: ssl.SSLContext | None = None, names: Collection[str] = ()) -> None:
        self._admit, self._tls, self._names = admit, tls, names
        self._files, self._talkers = files(), 0
        self._server = HttpServer(self._serve, "speech", tls, ADD_ON_LIMITS)

    async def run(self, host: str, port: int, listening: Callable[[str], None] = lambda url: None) -> None:
        """Serve until cancelled; ``listening`` is called with the page's address."""

        def tell(own_host: str, own_port: int) -> None:
            shown = f"[{own_host}]" if ":" in own_host else own_host
            listening(f"{'https' if self._tls else 'http'}://{shown}:{own_port}/")

        await self._server.run(host, port, tell)

    async def _serve(self, request: web.BaseRequest) -> web.StreamResponse:
        if not is_own_host(request.headers.get("Host", ""), self._names):
            return _refuse(HTTPStatus.MISDIRECTED_REQUEST, "this name is not the robot's: see --host-name")
        if request.method not in ("GET", "HEAD"):
            return _refuse(HTTPStatus.METHOD_NOT_ALLOWED, "only GET is served here")
        if request.path == "/socket":
            return await self._serve_socket(request)
        if request.path not in self._files:
            return _refuse(HTTPStatus.NOT_FOUND, "there is no such page")
        content_type, body = self._files[request.path]
        return web.Response(body=body, headers={**HEADERS, "Content-Type": content_type})

    async def _serve_socket(self, request: web.BaseRequest) -> web.StreamResponse:
        headers = request.headers
        if not is_own_origin(headers.get("Origin"), headers.get("Host", ""), tls=self._tls is not None):
            return _refuse(HTTPStatus.FORBIDDEN, "a page of another site may not talk to this robot")
        response = web.WebSocketResponse(heartbeat=HEARTBEAT_S, max_msg_size=MOST_MESSAGE_BYTES)
        if not response.can_prepare(request).ok:
            return _refuse(HTTPStatus.UPGRADE_REQUIRED, "this is a WebSocket")
        await response.prepare(request)
        await self._talk(response, lambda: self._server.show_proof(request))
        return response

    async def _talk(
        self, socket: web.WebSocketResponse, show_proof: Callable[[], None] = lambda: None
    ) -> None:
        """Who has not shown a token within ``GREETING_S`` is sent away, and never counts as one who talks."""

        async def send(message: dict[str, Any]) -> None:
            with contextlib.suppress(ConnectionResetError):  # gone: that is told by what is read
                await socket.send_str(json.dumps(message))

        try:
            first = await socket.receive_json(timeout=GREETING_S)
            token = first.get("token") if isinstance(first, dict) else None
            talker = await self._admit(token if isinstance(token, str) else None, send)
        except NotAdmitted as why:
            await send({"refused": str(why)})
            return
        except (TimeoutError, TypeError, ValueError):  # silent, gone, or no page of ours
            return
        try:
            if self._talkers >= MOST_TALKERS:
                await send({"refused": "too many people talk to this robot"})
                return
            show_proof()
            self._talkers += 1
            try:
                await _relay(socket, talker)
            finally:
                self._talkers -= 1
        finally:
            await talker.leave()


async def _relay(socket: web.WebSocketResponse, talker: Talker) -> None:
    async for message in socket:
        if message.type is WSMsgType.BINARY:
            talker.add_sound(message.data)
        elif message.type is WSMsgType.TEXT:
            try:
                words = json.loads(message.data)
            except ValueError:
                return
            if not isinstance(words, dict):
                return
            await talker.take(words)


def _refuse(status: HTTPStatus, text: str) -> web.Response:
    return web.Response(status=status, text=f"{text}\n", headers=HEADERS)
