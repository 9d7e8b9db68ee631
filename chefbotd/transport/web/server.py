"""Serves the page's files, its WebSocket and the metrics over HTTP, after a check of the headers.

The WebSocket's handshake is HTTP. After it the transport is handed to a connection like those of the command socket.
"""

import asyncio
import json
import logging
import socket
from http import HTTPStatus
from importlib import resources
from typing import cast

import structlog
from aiohttp import web
from msgspec import Struct
from websockets.utils import accept_key

from chefbotd.logs import RateLimitedLog
from chefbotd.metrics import Metrics
from chefbotd.rpc.access import Guard
from chefbotd.rpc.connection_manager import Headroom
from chefbotd.rpc.jsonrpc import Failure
from chefbotd.rpc.parameters import is_loopback
from chefbotd.rpc.server import RpcServer
from chefbotd.rpc.session import Session
from chefbotd.transport.connection import SocketConnection
from chefbotd.transport.parameters import PageParameters
from chefbotd.transport.tcp import DescriptorLimit, listen
from chefbotd.transport.unread import UnreadSockets
from chefbotd.transport.web.framing import WebSocketFraming
from chefbotd.transport.web.origin import is_own_host, is_own_origin
from chefbotd.transport.web.prometheus import CONTENT_TYPE, exposition

TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}


class PageFile(Struct, frozen=True):
    """A file as it is sent."""

    content_type: str
    body: bytes


def page_files() -> dict[str, PageFile]:
    """Every file of the page by its path; ``/`` is ``index.html``."""
    folder = resources.files(__package__) / "page"
    files = {
        f"/{entry.name}": PageFile(TYPES[suffix], entry.read_bytes())
        for entry in folder.iterdir()
        if (suffix := entry.name.rpartition(".")[2]) in TYPES
    }
    return {"/": files["/index.html"], **files}


ACCEPT_AGAIN_S = 0.1
MAX_HTTP_CONNECTIONS = 64
"""Of those that are no WebSocket; the oldest gives way."""
END_S = 0.5
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

SILENT = logging.Logger("aiohttp", logging.CRITICAL + 1)
"""Any client can send bytes that are not HTTP; aiohttp would log a traceback each time."""

log = structlog.get_logger(__name__)


class WebSocketConnection(SocketConnection):
    """A connection on an upgraded HTTP transport; HTTP is notified of its end."""

    def __init__(
        self,
        rpc: RpcServer,
        unread: UnreadSockets,
        session: Session,
        plain: socket.socket | None,
        http: asyncio.Protocol,
    ) -> None:
        manager = rpc.connections
        framing = WebSocketFraming(manager.parameters.backlog_bytes)
        super().__init__(manager, unread, session, plain, framing)
        self._http = http
        self.gone = asyncio.Event()

    def connection_lost(self, exc: Exception | None) -> None:
        """Asyncio: the socket is gone."""
        super().connection_lost(exc)
        self._http.connection_lost(exc)
        self.gone.set()


class PageServer:
    """The page of one robot; tokens, roles and limits are those of the RPC server, TLS that of the command socket."""

    def __init__(self, rpc: RpcServer, parameters: PageParameters, guard: Guard, metrics: Metrics) -> None:
        self._rpc, self._parameters, self._guard, self._metrics = rpc, parameters, guard, metrics
        self.unread = UnreadSockets()
        rpc.arrivals.add_transport(self.unread.mark)
        self._files = page_files()
        self._descriptors = DescriptorLimit(rpc.connections.parameters.reserved_stop_connections)
        self._sockets: dict[asyncio.Protocol, socket.socket] = {}
        self._upgraded: set[asyncio.Protocol] = set()
        self._handshakes = 0
        self._listening = asyncio.Event()
        self._address = ("", 0)
        self._log = RateLimitedLog(log)

    async def run(self) -> None:
        """Serve until cancelled.

        Raises:
            CannotListen: the address cannot be listened on.
        """
        receive_bytes = self._rpc.connections.parameters.backlog_bytes
        listeners = listen(self._parameters.host, self._parameters.port, receive_bytes, "page.port")
        # A body is never read, and access is not logged: an address could tell what it should not.
        server = web.Server(
            self._handle, access_log=None, logger=SILENT, keepalive_timeout=15.0, lingering_time=0.0
        )
        try:
            self._announce(listeners[0].getsockname())
            async with asyncio.TaskGroup() as group:
                for listener in listeners:
                    group.create_task(self._accept(listener, server, group))
        finally:
            for listener in listeners:
                listener.close()
            await server.shutdown(END_S)

    def _announce(self, name: tuple[str, int]) -> None:
        self._address = host, port = name[0], name[1]
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

    async def _accept(self, listener: socket.socket, server: web.Server, group: asyncio.TaskGroup) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                accepted, _ = await loop.sock_accept(listener)
            except OSError as error:  # out of descriptors or of memory; the client waits in the kernel
                self._log.warning("client_not_accepted", error=str(error))
                await asyncio.sleep(ACCEPT_AGAIN_S)
                continue
            enough = self._descriptors.headroom(accepted.fileno()) is Headroom.ENOUGH
            if enough and self._handshakes < MAX_HTTP_CONNECTIONS:
                self._make_room(server)
                group.create_task(self._connect(accepted, server))
            else:
                accepted.close()
            await asyncio.sleep(0)

    def _make_room(self, server: web.Server) -> None:
        waiting = [connection for connection in server.connections if connection not in self._upgraded]
        if len(waiting) >= MAX_HTTP_CONNECTIONS and waiting[0].transport is not None:
            waiting[0].transport.abort()

    async def _connect(self, accepted: socket.socket, server: web.Server) -> None:
        tls = self._guard.tls
        self._handshakes += 1

        def protocol() -> asyncio.Protocol:
            handler = cast(asyncio.Protocol, server())
            if tls is None:
                self._sockets[handler] = accepted
            return handler

        try:
            await asyncio.get_running_loop().connect_accepted_socket(
                protocol,
                accepted,
                ssl=tls,
                ssl_handshake_timeout=None
                if tls is None
                else self._rpc.connections.parameters.authenticate_timeout_s,
            )
        except OSError as error:  # no TLS, a handshake that took too long, or the client has gone
            self._log.warning("client_not_admitted", error=str(error))
        finally:
            self._handshakes -= 1
            self._forget_sockets(server)

    def _forget_sockets(self, server: web.Server) -> None:
        alive = set(server.connections)
        for handler in [connection for connection in self._sockets if connection not in alive]:
            del self._sockets[handler]

    async def _handle(self, request: web.BaseRequest) -> web.StreamResponse:
        try:
            return await self._serve(request)
        except Exception as problem:  # noqa: BLE001 - told and logged: the page must not take the robot along
            self._log.warning("page_fault", path=request.path, error=repr(problem))
            return _answer(HTTPStatus.INTERNAL_SERVER_ERROR, "a fault in the daemon; it is in the log")

    async def _serve(self, request: web.BaseRequest) -> web.StreamResponse:
        if not is_own_host(request.headers.get("Host", ""), self._parameters.allowed_hosts):
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
        return web.Response(body=file.body, headers={**HEADERS, "Content-Type": file.content_type})

    def _figures(self, request: web.BaseRequest) -> web.Response:
        """The figures. Where tokens are configured, ``Authorization: Bearer`` is required."""
        scheme, _, token = request.headers.get("Authorization", "").partition(" ")
        keyring = self._guard.keyring
        if keyring is not None and (scheme.lower() != "bearer" or keyring.role_of(token) is None):
            return _answer(HTTPStatus.UNAUTHORIZED, "show a token: Authorization: Bearer TOKEN")
        return web.Response(body=exposition(self._metrics), headers={**HEADERS, "Content-Type": CONTENT_TYPE})

    async def _serve_socket(self, request: web.BaseRequest) -> web.Response:
        """The handshake (RFC 6455, section 4.2); then the connection lives on its own until it ends."""
        headers, transport = request.headers, request.transport
        if not is_own_origin(headers.get("Origin"), headers.get("Host", ""), tls=self._guard.tls is not None):
            return _answer(HTTPStatus.FORBIDDEN, "a page of another site may not talk to this robot")
        key = headers.get("Sec-WebSocket-Key", "")
        asked = (
            headers.get("Upgrade", "").lower() == "websocket"
            and "upgrade" in headers.get("Connection", "").lower()
        )
        if not asked or len(key) != 24 or headers.get("Sec-WebSocket-Version") != "13" or transport is None:
            return _answer(HTTPStatus.UPGRADE_REQUIRED, "this is a WebSocket of version 13")
        host, port = transport.get_extra_info("peername")[:2]
        session = self._rpc.connections.admit(host, port)
        if isinstance(session, Failure):
            text = json.dumps({"kind": str(session.kind), "message": session.message})
            return _answer(HTTPStatus.SERVICE_UNAVAILABLE, text)
        handler = cast(asyncio.Protocol, request.protocol)
        connection = WebSocketConnection(self._rpc, self.unread, session, self._sockets.get(handler), handler)
        self._upgraded.add(handler)
        transport.write(_switching(key))
        transport.set_protocol(connection)
        connection.connection_made(transport)
        transport.resume_reading()
        try:
            await connection.gone.wait()
        finally:
            self._upgraded.discard(handler)
            self._sockets.pop(handler, None)
        return web.Response()


def _switching(key: str) -> bytes:
    return (
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Accept: {accept_key(key)}\r\n\r\n"
    ).encode()


def _answer(status: HTTPStatus, text: str) -> web.Response:
    return web.Response(status=status, text=text + "\n", headers=HEADERS)
