"""Serves the page's files, its WebSocket and the metrics over HTTP, after a check of the headers.

The WebSocket's handshake is HTTP. After it the transport is handed to a connection like those of the command socket.
"""

import asyncio
import gzip
import json
from collections.abc import Sequence
from http import HTTPStatus
from importlib import resources
from pathlib import Path
from typing import cast

import structlog
from aiohttp import web
from msgspec import Struct

from chefbotd.logs import RateLimitedLog
from chefbotd.metrics import Metrics
from chefbotd.rpc.access import Guard
from chefbotd.rpc.jsonrpc import Failure
from chefbotd.rpc.parameters import is_loopback
from chefbotd.rpc.server import RpcServer
from chefbotd.transport.parameters import PageParameters
from chefbotd.transport.unread import UnreadSockets
from chefbotd.transport.web.framing import WebSocketFraming
from chefbotd.transport.web.http_server import HttpLimits, HttpServer
from chefbotd.transport.web.languages import language_files, read_catalogues
from chefbotd.transport.web.origin import is_own_host, is_own_origin
from chefbotd.transport.web.prometheus import CONTENT_TYPE, exposition
from chefbotd.transport.web.websocket import WebSocketConnection, is_websocket, switch

log = structlog.get_logger(__name__)

TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "json": "application/json",
    "svg": "image/svg+xml",
}


class PageFile(Struct, frozen=True):
    """A file as it is sent, also to whom takes it compressed."""

    content_type: str
    body: bytes
    compressed: bytes


def page_file(kind: str, body: bytes) -> PageFile:
    """A file of a kind of ``TYPES``; compressed once, with no time in it, so that it is the same after a restart."""
    return PageFile(TYPES[kind], body, gzip.compress(body, mtime=0))


class Card(Struct, frozen=True):
    """A component's part of the page: where it stands, and the path of its JavaScript."""

    name: str
    file: Path
    panel: str = "workshop"
    title: str = ""
    order: int = 50
    for_guests: bool = False


def page_files(cards: Sequence[Card] = ()) -> dict[str, PageFile]:
    """Every file of the page by its path; ``/`` is ``index.html``, ``/cards.js`` lists the cards of components.

    The JavaScript and the style sheets beside a card's are served beside it; its languages go into those of the page.
    """
    folder = resources.files(__package__) / "page"
    files = {
        f"/{entry.name}": page_file(suffix, entry.read_bytes())
        for entry in folder.iterdir()
        if (suffix := entry.name.rpartition(".")[2]) in TYPES
    }
    listed = []
    for card in cards:
        base = f"/components/{card.name}"
        try:
            paths = {
                card.file,
                *(path for kind in ("js", "css") for path in card.file.parent.glob(f"*.{kind}")),
            }
            files |= {f"{base}/{path.name}": page_file(path.suffix[1:], path.read_bytes()) for path in paths}
        except OSError as error:
            log.error("a card of the page is left out", component=card.name, reason=str(error))
        else:
            module = f".{base}/{card.file.name}"
            style = f"{base}/{card.file.stem}.css"
            place = {
                "panel": card.panel,
                "title": card.title,
                "order": card.order,
                "for_guests": card.for_guests,
            }
            listed.append(
                {"name": card.name, "module": module, "style": f".{style}" if style in files else "", **place}
            )
    words = read_catalogues([("", folder), *((card.name, card.file.parent) for card in cards)])
    files |= {path: page_file(path.rpartition(".")[2], body) for path, body in language_files(words).items()}
    files["/cards.js"] = page_file("js", f"export const CARDS = {json.dumps(listed)};\n".encode())
    return {"/": files["/index.html"], **files}


MOST_SHOWN = 200
"""Characters of a foreign header in the log."""
SOCKET_PATH = "/socket"
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}


class PageServer:
    """The page of one robot; tokens, roles and limits are those of the RPC server, TLS that of the command socket."""

    def __init__(
        self,
        rpc: RpcServer,
        parameters: PageParameters,
        guard: Guard,
        metrics: Metrics,
        cards: Sequence[Card] = (),
    ) -> None:
        self._rpc, self._parameters, self._guard, self._metrics = rpc, parameters, guard, metrics
        self.unread = UnreadSockets()
        rpc.arrivals.add_transport(self.unread.mark)
        self._files = page_files(cards)
        self._log = RateLimitedLog(log)
        limits = rpc.connections.parameters
        self._http = HttpServer(
            self._serve,
            __name__,
            guard.tls,
            HttpLimits(
                silent=limits.max_new_connections,
                header_s=limits.authenticate_timeout_s,
                receive_bytes=limits.backlog_bytes,
            ),
            reserved_descriptors=limits.reserved_stop_connections,
        )
        self._listening = asyncio.Event()
        self._address = ("", 0)

    async def run(self) -> None:
        """Serve until cancelled.

        Raises:
            CannotListen: the address cannot be listened on.
        """
        await self._http.run(
            self._parameters.host, self._parameters.port, self._announce_address, "page.port"
        )

    def _announce_address(self, host: str, port: int) -> None:
        self._address = host, port
        self._listening.set()
        shown = f"[{host}]" if ":" in host else host
        tls = self._guard.tls is not None
        log.info("page_listening", url=f"{'https' if tls else 'http'}://{shown}:{port}/")
        if not is_loopback(host) and not tls:
            log.warning(
                "page_not_encrypted", hint="set api.tls_certificate and api.tls_key: tokens can be overheard"
            )

    async def address(self) -> tuple[str, int]:
        """Where the page is; waits until it is there."""
        await self._listening.wait()
        return self._address

    async def _serve(self, request: web.BaseRequest) -> web.StreamResponse:
        host = request.headers.get("Host", "")
        if not is_own_host(host, self._parameters.host_names):
            hint = "if this is the robot's name, add it to page.allowed_hosts; of a proxy, its origin to page.origins"
            self._log.warning("page_name_refused", name=host[:MOST_SHOWN], hint=hint)
            reason = "this name is not the robot's: add it to page.allowed_hosts, or use its address"
            return _answer(HTTPStatus.MISDIRECTED_REQUEST, reason)
        if request.method not in ("GET", "HEAD"):
            return _answer(HTTPStatus.METHOD_NOT_ALLOWED, "only GET is served here")
        if request.path == SOCKET_PATH:
            return await self._serve_socket(request)
        if request.path == "/metrics":
            return self._figures(request)
        file = self._files.get(request.path)
        if file is None:
            return _answer(HTTPStatus.NOT_FOUND, "there is no such page")
        headers = {**HEADERS, "Content-Type": file.content_type, "Vary": "Accept-Encoding"}
        if "gzip" not in request.headers.get("Accept-Encoding", ""):
            return web.Response(body=file.body, headers=headers)
        return web.Response(body=file.compressed, headers={**headers, "Content-Encoding": "gzip"})

    def _figures(self, request: web.BaseRequest) -> web.Response:
        """The figures. Where tokens are configured, ``Authorization: Bearer`` is required."""
        scheme, _, token = request.headers.get("Authorization", "").partition(" ")
        keyring = self._guard.keyring
        if keyring is not None and (scheme.lower() != "bearer" or keyring.role_of(token) is None):
            return _answer(HTTPStatus.UNAUTHORIZED, "show a token: Authorization: Bearer TOKEN")
        return web.Response(body=exposition(self._metrics), headers={**HEADERS, "Content-Type": CONTENT_TYPE})

    async def _serve_socket(self, request: web.BaseRequest) -> web.Response:
        """The handshake; then the connection lives on its own until it ends."""
        headers, transport = request.headers, request.transport
        origin, host = headers.get("Origin"), headers.get("Host", "")
        own = self._parameters.origins
        if not is_own_origin(origin, host, tls=self._guard.tls is not None, allowed=own):
            shown = str(origin)[:MOST_SHOWN]
            hint = f'if a proxy of yours shows the page there, set [page] origins = ["{shown}"]'
            self._log.warning("page_origin_refused", origin=shown, name=host[:MOST_SHOWN], hint=hint)
            return _answer(HTTPStatus.FORBIDDEN, "a page of another site may not talk to this robot")
        if not is_websocket(request) or transport is None:
            return _answer(HTTPStatus.UPGRADE_REQUIRED, "this is a WebSocket of version 13")
        manager = self._rpc.connections
        session = manager.admit(*transport.get_extra_info("peername")[:2])
        if isinstance(session, Failure):
            text = json.dumps({"kind": str(session.kind), "message": session.message})
            return _answer(HTTPStatus.SERVICE_UNAVAILABLE, text)
        connection = WebSocketConnection(
            manager,
            self.unread,
            session,
            self._http.plain_socket(request),
            cast(asyncio.Protocol, request.protocol),
            WebSocketFraming(manager.parameters.backlog_bytes),
        )
        self._http.show_proof(request)  # its limits are those of the connection manager now
        switch(request, connection)
        await connection.gone.wait()
        return web.Response()


def _answer(status: HTTPStatus, text: str) -> web.Response:
    return web.Response(status=status, text=text + "\n", headers=HEADERS)
