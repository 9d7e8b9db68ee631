"""The command socket: one JSON object per line over TCP, with TLS if it is configured.

There is one listening socket per address, and a client is admitted before its TLS handshake. The accept loop is our own
and not ``create_server``'s. It refuses with a reason as long as descriptors are left, accepts one client per iteration
of the event loop, and survives the kernel's errors.
"""

import asyncio
import contextlib
import errno
import os
import resource
import select
import socket
import ssl

import structlog

from chefbotd.logs import RateLimitedLog
from chefbotd.rpc import jsonrpc
from chefbotd.rpc.arrivals import Arrival, Arrivals
from chefbotd.rpc.connection_manager import ConnectionManager, Headroom
from chefbotd.rpc.jsonrpc import Failure
from chefbotd.rpc.parameters import ApiParameters, is_loopback
from chefbotd.rpc.server import RpcServer
from chefbotd.rpc.session import Session
from chefbotd.transport.connection import SocketConnection
from chefbotd.transport.unread import UnreadSockets

BACKLOG = 128
RESERVED_DESCRIPTORS = 32
"""Left for the serial link to reopen its device, for the places kept for stops, and for all that is no client."""
CLOSING_DESCRIPTORS = 8
"""Left for new clients until those that were disconnected for them have closed their own."""


class CannotListen(OSError):
    """An address that cannot be listened on; its text is ready to be shown."""

    def __str__(self) -> str:
        return str(self.strerror)


class DescriptorLimit:
    """How many file descriptors are left for clients, by the number of a new one: it is the lowest that is free."""

    def __init__(self, reserved_stop_connections: int) -> None:
        self._low = resource.getrlimit(resource.RLIMIT_NOFILE)[0] - RESERVED_DESCRIPTORS
        self._none = self._low + reserved_stop_connections + CLOSING_DESCRIPTORS

    def headroom(self, descriptor: int) -> Headroom:
        """What a client with this descriptor finds."""
        if descriptor >= self._none:
            return Headroom.NONE
        return Headroom.LOW if descriptor >= self._low else Headroom.ENOUGH


def listen(host: str, port: int, receive_bytes: int, option: str) -> list[socket.socket]:
    """Listen on every address of a host, which is looked up while nothing runs yet.

    ``receive_bytes`` bounds what the kernel holds for each client; ``option`` chooses another port, for the message.

    Raises:
        CannotListen: one of them cannot be listened on, or there is no such host.
    """
    listeners: list[socket.socket] = []
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        for family, _, _, _, address in dict.fromkeys(addresses):
            listener = socket.create_server(address, family=family, backlog=BACKLOG)
            listeners.append(listener)
            # Accepted sockets inherit this bound on the requests that the kernel holds.
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
            listener.setblocking(False)
    except OSError as error:
        for listener in listeners:
            listener.close()
        number = error.errno or 0  # a look-up's are negative; a socket's own text repeats the address
        why = (os.strerror(number) if number > 0 else str(error.strerror)).lower()
        if number == errno.EADDRINUSE:
            why += f"; is another chefbotd running? {option} chooses another port"
        raise CannotListen(error.errno, f"cannot listen on {host}:{port}: {why}") from error
    return listeners


ACCEPT_AGAIN_S = 0.1

log = structlog.get_logger(__name__)


class _AcceptQueue:
    """The clients that wait in the kernel at one listening socket, and the earliest time they can have arrived."""

    def __init__(self, listener: socket.socket, arrivals: Arrivals, unread: UnreadSockets) -> None:
        self._arrivals = arrivals
        self._oldest: Arrival | None = None
        self._poll = select.poll()
        self._poll.register(listener, select.POLLIN)
        unread.register(listener.fileno(), self)

    def mark_unread(self, arrival: Arrival) -> None:
        """A stop is carried out while a client waits."""
        self._oldest = self._oldest or arrival

    def next_arrival(self) -> Arrival:
        """The earliest arrival of the client that was just accepted."""
        arrival = self._oldest or self._arrivals.earliest()
        self._oldest = arrival if self._poll.poll(0) else None
        return arrival


class Listener:
    """Accepts clients and hands them to the connection manager; through TLS, if there is a context for it."""

    def __init__(
        self, connections: ConnectionManager, unread: UnreadSockets, tls: ssl.SSLContext | None
    ) -> None:
        self._manager, self._unread, self._tls = connections, unread, tls
        self._descriptors = DescriptorLimit(connections.parameters.reserved_stop_connections)
        self._listeners: list[socket.socket] = []
        self._log = RateLimitedLog(structlog.get_logger(__name__))

    def listen(self, host: str, port: int) -> tuple[str, int]:
        """Listen on every address of a host; the first one's name and port.

        Raises:
            CannotListen: one of them cannot be listened on, or there is no such host.
        """
        receive_bytes = self._manager.parameters.backlog_bytes
        self._listeners = listen(host, port, receive_bytes, "--listen HOST:PORT")
        name: tuple[str, int] = self._listeners[0].getsockname()[:2]
        return name

    async def run(self) -> None:
        """Accept clients until cancelled."""
        async with asyncio.TaskGroup() as group:
            for listener in self._listeners:
                group.create_task(self._accept(listener, group))

    def close(self) -> None:
        """Listen no more."""
        for listener in self._listeners:
            listener.close()

    async def _accept(self, listener: socket.socket, group: asyncio.TaskGroup) -> None:
        loop, queue = asyncio.get_running_loop(), _AcceptQueue(listener, self._manager.arrivals, self._unread)
        while True:
            try:
                accepted, address = await loop.sock_accept(listener)
            except OSError as error:  # out of descriptors or of memory; the client waits in the kernel
                self._log.warning("client_not_accepted", error=str(error))
                await asyncio.sleep(ACCEPT_AGAIN_S)
                continue
            host, port = address[:2]
            headroom = self._descriptors.headroom(accepted.fileno())
            admitted = self._manager.admit(host, port, queue.next_arrival(), headroom)
            if isinstance(admitted, Failure):
                self._refuse(accepted, admitted)
            else:
                handshake = group.create_task(self._connect(accepted, admitted))
                if self._tls is not None:
                    self._manager.add_handshake(admitted, handshake.cancel)
            await asyncio.sleep(0)

    def _refuse(self, accepted: socket.socket, failure: Failure) -> None:
        with accepted, contextlib.suppress(OSError):  # it may have gone already
            if self._tls is None:
                accepted.send(jsonrpc.error(failure) + b"\n")

    async def _connect(self, accepted: socket.socket, session: Session) -> None:
        handshake_timeout_s = None if self._tls is None else self._manager.parameters.authenticate_timeout_s
        try:
            await asyncio.get_running_loop().connect_accepted_socket(
                lambda: SocketConnection(
                    self._manager, self._unread, session, accepted if self._tls is None else None
                ),
                accepted,
                ssl=self._tls,
                ssl_handshake_timeout=handshake_timeout_s,
            )
        except OSError as error:  # no TLS, a handshake that took too long, or the client has gone
            self._log.warning("client_not_admitted", client=str(session), error=str(error))
            self._manager.remove(session)


class TcpServer:
    """Serves the clients of one address, through TLS if there is a context for it."""

    def __init__(self, rpc: RpcServer, parameters: ApiParameters, tls: ssl.SSLContext | None = None) -> None:
        self.unread = UnreadSockets()
        rpc.arrivals.add_transport(self.unread.mark)
        self._parameters, self._tls = parameters, tls
        self._listener = Listener(rpc.connections, self.unread, tls)
        self._listening = asyncio.Event()
        self._address = ("", 0)

    async def run(self) -> None:
        """Accept clients until cancelled.

        Raises:
            CannotListen: the address cannot be listened on.
        """
        self._address = self._listener.listen(self._parameters.host, self._parameters.port)
        try:
            self._announce()
            await self._listener.run()
        finally:
            self._listener.close()

    def _announce(self) -> None:
        host, port = self._address
        self._listening.set()
        log.info("api_listening", host=host, port=port, tls=self._tls is not None)
        if not is_loopback(host) and self._tls is None:
            log.warning(
                "api_not_encrypted", hint="set api.tls_certificate and api.tls_key: tokens can be overheard"
            )

    async def address(self) -> tuple[str, int]:
        """Where the server listens; waits until it does."""
        await self._listening.wait()
        return self._address
