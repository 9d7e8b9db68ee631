"""From an HTTP request to a WebSocket, as a connection like those of the command socket (RFC 6455, section 4.2)."""

import asyncio
import socket
from http import HTTPStatus

from aiohttp import web
from websockets.frames import Close, Frame, Opcode
from websockets.utils import accept_key

from chefbotd.rpc.connection_manager import ConnectionManager
from chefbotd.rpc.session import Session
from chefbotd.transport.connection import SocketConnection
from chefbotd.transport.unread import UnreadSockets
from chefbotd.transport.web.framing import WebSocketFraming

LONGEST_REASON_BYTES = 123
"""A control frame has at most 125 bytes (5.5), two of them are the code."""


class WebSocketConnection(SocketConnection):
    """A connection on an upgraded HTTP transport; HTTP is notified of its end.

    ``gone``: the socket is; ``over``: so are the requests among what had arrived.
    """

    def __init__(
        self,
        manager: ConnectionManager,
        unread: UnreadSockets,
        session: Session,
        plain: socket.socket | None,
        http: asyncio.Protocol,
        framing: WebSocketFraming,
    ) -> None:
        super().__init__(manager, unread, session, plain, framing)
        self._http = http
        self.gone, self.over = asyncio.Event(), asyncio.Event()

    def finish(self) -> None:
        """Nothing of it is left to be served."""
        self.over.set()

    def connection_lost(self, exc: Exception | None) -> None:
        """Asyncio: the socket is gone."""
        super().connection_lost(exc)
        self._http.connection_lost(exc)
        self.gone.set()


def is_websocket(request: web.BaseRequest) -> bool:
    """Whether a request asks for a WebSocket of version 13."""
    headers = request.headers
    return (
        headers.get("Upgrade", "").lower() == "websocket"
        and "upgrade" in headers.get("Connection", "").lower()
        and len(headers.get("Sec-WebSocket-Key", "")) == 24
        and headers.get("Sec-WebSocket-Version") == "13"
        and request.transport is not None
    )


def switch(request: web.BaseRequest, connection: WebSocketConnection) -> None:
    """Have the connection take over from HTTP."""
    transport = request.transport
    if transport is None:
        raise ConnectionResetError("the client is gone")
    transport.write(_switching(request))
    transport.set_protocol(connection)
    connection.connection_made(transport)
    transport.resume_reading()


def turn_away(request: web.BaseRequest, code: int, reason: str) -> web.Response:
    """Open the WebSocket to close it with a code and a reason: a browser shows these, and hides a failed handshake."""
    transport = request.transport
    if transport is not None:
        text = reason.encode()[:LONGEST_REASON_BYTES].decode(errors="ignore")
        close = Frame(Opcode.CLOSE, Close(code, text).serialize()).serialize(mask=False)
        transport.write(_switching(request) + close)
        transport.close()
    return web.Response(status=HTTPStatus.FORBIDDEN)


def _switching(request: web.BaseRequest) -> bytes:
    return (
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Accept: {accept_key(request.headers['Sec-WebSocket-Key'])}\r\n\r\n"
    ).encode()
