"""Where clients come in: one listener per address, each newcomer counted before it costs a TLS handshake.

Accepting is our own loop and not ``create_server``'s: it says no with a reason while descriptors are left, takes one
newcomer per turn of the event loop, and lives through the kernel's refusals.
"""

import asyncio
import contextlib
import errno
import os
import select
import socket
import ssl

import structlog

from chefbotd.logs import RateLimitedLog
from chefbotd.rpc import jsonrpc
from chefbotd.rpc.connection_manager import ConnectionManager
from chefbotd.rpc.jsonrpc import Failure
from chefbotd.rpc.session import Session
from chefbotd.transport.tcp.arrivals import Arrival, Arrivals
from chefbotd.transport.tcp.connection import Connection

BACKLOG = 128
ACCEPT_AGAIN_S = 0.1


class CannotListen(OSError):
    """An address that cannot be listened on; its text is ready to be shown."""

    def __str__(self) -> str:
        return str(self.strerror)


class _Queue:
    """Who waits at a listener in the kernel, and how long that may be since."""

    def __init__(self, listener: socket.socket, arrivals: Arrivals) -> None:
        self._arrivals = arrivals
        self._oldest: Arrival | None = None
        self._more = select.poll()
        self._more.register(listener, select.POLLIN)
        arrivals.watch(listener.fileno(), self)

    def came_before(self, arrival: Arrival) -> None:
        """A stop is carried out while somebody waits."""
        self._oldest = self._oldest or arrival

    def next(self) -> Arrival:
        """The earliest at which the one who was just let in can have come."""
        came = self._oldest or self._arrivals.earliest()
        self._oldest = came if self._more.poll(0) else None
        return came


class Listener:
    """Lets clients into the lobby; through TLS, if there is a context for it."""

    def __init__(self, lobby: ConnectionManager, tls: ssl.SSLContext | None) -> None:
        self._lobby, self._tls = lobby, tls
        self._listeners: list[socket.socket] = []
        self._log = RateLimitedLog(structlog.get_logger(__name__))

    def listen(self, host: str, port: int) -> tuple[str, int]:
        """Listen on every address of a host, which is looked up while nothing runs yet; the first one's name and port.

        Raises:
            CannotListen: one of them cannot be listened on, or there is no such host.
        """
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
            for family, _, _, _, address in dict.fromkeys(found):
                listener = socket.create_server(address, family=family, backlog=BACKLOG)
                self._listeners.append(listener)
                # Newcomers inherit it: what the kernel holds of a client's requests is bounded, as what we hold is.
                listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, self._lobby.parameters.backlog_bytes)
                listener.setblocking(False)
        except OSError as error:
            self.close()
            number = error.errno or 0  # a look-up's are negative; a socket's own text repeats the address
            why = (os.strerror(number) if number > 0 else str(error.strerror)).lower()
            if number == errno.EADDRINUSE:
                why += "; is another chefbotd running? --listen HOST:PORT chooses another port"
            raise CannotListen(error.errno, f"cannot listen on {host}:{port}: {why}") from error
        name: tuple[str, int] = self._listeners[0].getsockname()[:2]
        return name

    async def run(self) -> None:
        """Let clients in until cancelled."""
        async with asyncio.TaskGroup() as group:
            for listener in self._listeners:
                group.create_task(self._accept(listener, group))

    def close(self) -> None:
        """Listen no more."""
        for listener in self._listeners:
            listener.close()

    async def _accept(self, listener: socket.socket, group: asyncio.TaskGroup) -> None:
        loop, queue = asyncio.get_running_loop(), _Queue(listener, self._lobby.arrivals)
        while True:
            try:
                newcomer, address = await loop.sock_accept(listener)
            except OSError as error:  # out of descriptors or of memory; the client waits in the kernel
                self._log.warning("client_not_accepted", error=str(error))
                await asyncio.sleep(ACCEPT_AGAIN_S)
                continue
            host, port = address[:2]
            admitted = self._lobby.admit(host, port, newcomer.fileno(), queue.next())
            if isinstance(admitted, Failure):
                self._send_away(newcomer, admitted)
            else:
                handshake = group.create_task(self._let_in(newcomer, admitted))
                if self._tls is not None:
                    self._lobby.shakes_hands(admitted, handshake.cancel)
            await asyncio.sleep(0)

    def _send_away(self, newcomer: socket.socket, failure: Failure) -> None:
        with newcomer, contextlib.suppress(OSError):  # it may have gone already
            if self._tls is None:
                newcomer.send(jsonrpc.error(failure))

    async def _let_in(self, newcomer: socket.socket, session: Session) -> None:
        patience_s = None if self._tls is None else self._lobby.parameters.authenticate_s
        try:
            await asyncio.get_running_loop().connect_accepted_socket(
                lambda: Connection(self._lobby, session, newcomer if self._tls is None else None),
                newcomer,
                ssl=self._tls,
                ssl_handshake_timeout=patience_s,
            )
        except OSError as error:  # no TLS, a handshake that took too long, or the client has gone
            self._log.warning("client_not_let_in", client=str(session), error=str(error))
            self._lobby.leave(session)
