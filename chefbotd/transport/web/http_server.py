"""An HTTP server for the daemon's page and for programs beside it. Anybody on the network may try to fill it.

It bounds the connections, which addresses share fairly, the time until a request is complete, the time until a token is
shown, and the file descriptors, so that the program's own connections (to a broker, to the daemon) always find one. A
request whose handler fails is answered, counted and logged once, and ends nothing else.
"""

import asyncio
import logging
import socket
import ssl
from collections import Counter
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from typing import Any, cast

import structlog
from aiohttp import web
from msgspec import Struct

from chefbotd.core.record import Record
from chefbotd.logs import RateLimitedLog
from chefbotd.rpc.connection_manager import Headroom
from chefbotd.rpc.connection_slots import ConnectionSlots, NoSlot
from chefbotd.transport.tcp import ACCEPT_AGAIN_S, NO_TLS, DescriptorLimit, first_bytes, listen

SILENT = logging.Logger("aiohttp", logging.CRITICAL + 1)
"""Any client can send bytes that are not HTTP; aiohttp would log a traceback each time."""

END_S = 0.5

Handle = Callable[[web.BaseRequest], Awaitable[web.StreamResponse]]


class HttpLimits(Record, frozen=True):
    """Of connections that have shown no token: how many that are silent or have spoken, how long each step may take.

    ``least_s``: so long each keeps its slot. ``header_s``: until a request is complete, ``idle_s``: between two,
    ``request_s``: for its body, its answer, or the token. ``receive_bytes`` bounds what the kernel holds of each.
    """

    silent: int = 2048
    connections: int = 256
    least_s: float = 1.0
    header_s: float = 5.0
    idle_s: float = 15.0
    request_s: float = 10.0
    body_bytes: int = 65_536
    receive_bytes: int = 65_536


ADD_ON_LIMITS = HttpLimits(silent=256, connections=64)
"""Of a program that has the usual 1024 descriptors, and few people in front of it."""


class _Connection(Struct, eq=False):
    """One accepted socket; ``end`` ends it, whatever it does."""

    host: str
    plain: socket.socket | None
    end: Callable[[], object]
    is_connected: bool = False
    timer: asyncio.TimerHandle | None = None
    limit: asyncio.Timeout | None = None


class HttpServer:
    """``handle`` answers requests; ``name`` is for the log. ``refused`` counts by reason, ``faults`` by path.

    ``make_request`` is that of an aiohttp application, where there is one.
    """

    def __init__(
        self,
        handle: Handle,
        name: str,
        tls: ssl.SSLContext | None = None,
        limits: HttpLimits | None = None,
        make_request: Callable[..., web.BaseRequest] | None = None,
        reserved_descriptors: int = 0,
    ) -> None:
        self._make_request = make_request or self._new_request
        self._handler, self.tls, self._limits = handle, tls, limits or HttpLimits()
        limits = self._limits
        self._silent = ConnectionSlots[_Connection](limits.silent, limits.least_s)
        self._speaking = ConnectionSlots[_Connection](limits.connections, limits.least_s)
        self._connections: dict[asyncio.Protocol, _Connection] = {}
        self._descriptors = DescriptorLimit(reserved_descriptors)
        self._log = RateLimitedLog(structlog.get_logger(name))
        self.refused: Counter[str] = Counter()
        self.faults: Counter[str] = Counter()

    async def run(
        self,
        host: str,
        port: int,
        listening: Callable[[str, int], None] = lambda host, port: None,
        option: str = "--port",
    ) -> None:
        """Serve until cancelled; ``listening`` is told where, ``option`` chooses another port, for the message.

        Raises:
            CannotListen: the address cannot be listened on.
        """
        listeners = listen(host, port, self._limits.receive_bytes, option)
        server = web.Server(
            self._handle,
            request_factory=self._make_request,
            access_log=None,  # an address could tell what it should not
            logger=SILENT,
            keepalive_timeout=self._limits.idle_s,
            lingering_time=0.0,
        )
        try:
            listening(*listeners[0].getsockname()[:2])
            async with asyncio.TaskGroup() as group:
                for listener in listeners:
                    group.create_task(self._accept_connections(listener, server, group))
        finally:
            for listener in listeners:
                listener.close()
            await server.shutdown(END_S)

    def show_proof(self, request: web.BaseRequest) -> None:
        """This request's connection has shown a token: it is never replaced, and has no limit of time any more.

        Whoever calls this limits how many there are.
        """
        connection = self._connections.get(cast(asyncio.Protocol, request.protocol))
        if connection is not None:
            self._speaking.remove(connection)
            if connection.limit is not None:
                connection.limit.reschedule(None)

    def plain_socket(self, request: web.BaseRequest) -> socket.socket | None:
        """The request's socket, where what it holds is not encrypted."""
        connection = self._connections.get(cast(asyncio.Protocol, request.protocol))
        return None if connection is None else connection.plain

    # accepting

    async def _accept_connections(
        self, listener: socket.socket, server: web.Server, group: asyncio.TaskGroup
    ) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                accepted, address = await loop.sock_accept(listener)
                accepted = self._descriptors.move_up(accepted)
            except OSError as error:  # out of descriptors or of memory; the client waits in the kernel
                self._log.warning("client_not_accepted", error=str(error))
                await asyncio.sleep(ACCEPT_AGAIN_S)
                continue
            self._admit(accepted, str(address[0]), server, group)
            await asyncio.sleep(0)

    def _admit(
        self, accepted: socket.socket, host: str, server: web.Server, group: asyncio.TaskGroup
    ) -> None:
        connection = _Connection(host, accepted if self.tls is None else None, accepted.close)
        headroom = self._descriptors.headroom(accepted.fileno())
        try:
            if headroom is Headroom.NONE:
                raise NoSlot("short of file descriptors")
            self._take_slot(self._silent, connection, scarce=headroom is Headroom.LOW)
        except NoSlot as why:
            self.count_refused(host, "no place", str(why))
            accepted.close()
            return
        task = group.create_task(self._connect(accepted, connection, server))
        connection.end = task.cancel
        connection.timer = asyncio.get_running_loop().call_later(
            self._limits.header_s, self._end_late, connection
        )

    def _take_slot(
        self, slots: ConnectionSlots[_Connection], connection: _Connection, *, scarce: bool = False
    ) -> None:
        now_s = asyncio.get_running_loop().time()
        for replaced in slots.add(connection, connection.host, now_s, scarce=scarce):
            self.count_refused(
                replaced.host, "replaced", "a connection without a token was replaced by a new one"
            )
            replaced.end()

    def count_refused(self, host: str, kind: str, why: str) -> None:
        """Count a client that is not served, or no longer; the first is logged at once, the rest as a count."""
        self.refused[kind] += 1
        self._log.warning("client_refused", host=host, why=why, refused=self.refused.total())

    def _end_late(self, connection: _Connection) -> None:
        self.count_refused(connection.host, "late", f"no complete request within {self._limits.header_s:g} s")
        self._give_back(connection)
        connection.end()

    def _give_back(self, connection: _Connection) -> None:
        self._silent.remove(connection)
        self._speaking.remove(connection)
        if connection.timer is not None:
            connection.timer.cancel()

    async def _connect(self, accepted: socket.socket, connection: _Connection, server: web.Server) -> None:
        handler: asyncio.Protocol | None = None
        try:
            await first_bytes(accepted, None)
            self._silent.remove(connection)
            self._forget_gone()
            self._take_slot(self._speaking, connection)
            handler = cast(asyncio.Protocol, server())
            self._connections[handler] = connection
            transport, _ = await asyncio.get_running_loop().connect_accepted_socket(
                lambda: handler,
                accepted,
                ssl=self.tls,
                ssl_handshake_timeout=None if self.tls is None else self._limits.header_s,
            )
            connection.end, connection.is_connected = transport.abort, True
        except NoSlot as why:
            self.count_refused(connection.host, "no place", str(why))
        except OSError as error:
            self._log.warning("client_not_admitted", error=str(error) or NO_TLS)
        finally:
            if not connection.is_connected:
                self._give_back(connection)
                if handler is not None:
                    del self._connections[handler]
                accepted.close()

    def _forget(self, handler: asyncio.Protocol) -> None:
        self._give_back(self._connections.pop(handler))

    def _forget_gone(self) -> None:
        for handler, connection in list(self._connections.items()):
            if connection.is_connected and getattr(handler, "transport", None) is None:
                self._forget(handler)

    # requests

    def _new_request(self, message: Any, payload: Any, protocol: Any, writer: Any, task: Any) -> Any:
        loop = asyncio.get_running_loop()
        return web.BaseRequest(
            message, payload, protocol, writer, task, loop, client_max_size=self._limits.body_bytes
        )

    async def _handle(self, request: web.BaseRequest) -> web.StreamResponse:
        handler = cast(asyncio.Protocol, request.protocol)
        connection = self._connections.get(handler) or _Connection("", None, lambda: None)
        if connection.timer is not None:
            connection.timer.cancel()
        self._speaking.renew(connection, asyncio.get_running_loop().time())
        try:
            async with asyncio.timeout(self._limits.request_s) as connection.limit:
                return await self._answer(request)
        except TimeoutError:
            self.count_refused(str(request.remote), "late", f"not done within {self._limits.request_s:g} s")
            connection.end()
            return plain_answer(HTTPStatus.REQUEST_TIMEOUT, "this took too long")
        finally:
            connection.limit = None
            connection.timer = asyncio.get_running_loop().call_later(
                self._limits.idle_s, self._end_idle, handler, connection
            )

    def _end_idle(self, handler: asyncio.Protocol, connection: _Connection) -> None:
        if handler in self._connections:
            self._forget(handler)
            connection.end()

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        try:
            return await self._handler(request)
        except web.HTTPRequestEntityTooLarge:
            return plain_answer(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "the request is too long")
        except (web.HTTPException, ConnectionError, TimeoutError):
            raise
        except Exception as problem:  # noqa: BLE001 - told, counted and logged: one request must not end the program
            self.faults[request.path[:100]] += 1
            self._log.warning("request_fault", path=request.path[:100], error=repr(problem)[:500])
            return plain_answer(HTTPStatus.INTERNAL_SERVER_ERROR, "a fault in the program; it is in its log")


def plain_answer(status: HTTPStatus, text: str) -> web.Response:
    """A sentence."""
    return web.Response(status=status, text=text + "\n")
