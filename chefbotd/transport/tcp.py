"""The command socket: one JSON object per line over TCP, with TLS if it is configured.

There is one listening socket per address, and a client is admitted before its TLS handshake. The accept loop is our own
and not ``create_server``'s. It refuses with a reason as long as descriptors are left, accepts one client per iteration
of the event loop, and survives the kernel's errors.
"""

import asyncio
import contextlib
import errno
import fcntl
import os
import resource
import select
import socket
import ssl
import sys

import structlog

from chefbotd.logs import RateLimitedLog
from chefbotd.rpc import jsonrpc
from chefbotd.rpc.arrivals import Arrivals, ByteArrival
from chefbotd.rpc.connection_manager import ConnectionManager, Headroom
from chefbotd.rpc.connection_slots import ConnectionSlots, NoSlot
from chefbotd.rpc.jsonrpc import Failure
from chefbotd.rpc.parameters import ApiParameters, is_loopback
from chefbotd.rpc.server import RpcServer
from chefbotd.rpc.session import Session
from chefbotd.transport.connection import SocketConnection
from chefbotd.transport.unread import UnreadSockets

BACKLOG = 1024
"""What may wait while the event loop is busy: beyond it the kernel drops a client, which tries again after a second."""
RESERVED_DESCRIPTORS = 32
"""Left for the serial link to reopen its device, for the places kept for stops, and for all that is no client."""
CLOSING_DESCRIPTORS = 8
"""Left for new clients until those that were disconnected for them have closed their own."""
SEGMENT_BYTES = 16_384
"""The largest segment of TCP: half of what may be sent ahead by default (``ApiParameters.write_buffer_bytes``).

On loopback it would be 64 kB, and the receiver would wait for a second one before it acknowledged, 40 ms each time
(RFC 1122, 4.2.3.2).
"""
LEAST_CLIENT_DESCRIPTORS = 16
"""With fewer nobody could be served."""
MAX_HANDSHAKES = 256
"""Handshakes of TLS that have begun: each holds some 100 kB."""
NO_TLS = "it began no TLS in time, or has gone"
"""What the log says of a client whose end has no words of its own."""
FIRST_CLIENT_DESCRIPTOR = 1024
"""Clients' descriptors begin here where the limit allows: ``select``, as of pyserial, knows only those below."""
CLIENT_DESCRIPTORS = 8192
"""As many as all clients of the socket and of the page can have by default, and as many again."""


class CannotListen(OSError):
    """An address that cannot be listened on; its text is ready to be shown."""

    def __str__(self) -> str:
        return str(self.strerror)


def raise_descriptor_limit() -> None:
    """Let this process have as many descriptors as its clients may need, as far as its hard limit allows."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    target = FIRST_CLIENT_DESCRIPTOR + CLIENT_DESCRIPTORS
    if soft != resource.RLIM_INFINITY and soft < target:
        most = target if hard == resource.RLIM_INFINITY else min(target, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, most), hard))


def require_descriptors(reserved_stop_connections: int) -> None:
    """Raise ``CannotListen`` where the limit leaves no descriptors for clients."""
    limit = _descriptor_limit()
    least = RESERVED_DESCRIPTORS + CLOSING_DESCRIPTORS + LEAST_CLIENT_DESCRIPTORS + reserved_stop_connections
    if limit < least:
        raise CannotListen(
            errno.EMFILE,
            f"this process may open {limit} files, and needs {least} to serve anybody: raise the limit with "
            f"ulimit -n {FIRST_CLIENT_DESCRIPTOR}, or LimitNOFILE={FIRST_CLIENT_DESCRIPTOR} in a systemd unit",
        )


def _descriptor_limit() -> int:
    soft = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return sys.maxsize if soft == resource.RLIM_INFINITY else soft


class DescriptorLimit:
    """How many file descriptors are left for clients, by the number of a new one: it is the lowest that is free."""

    def __init__(self, reserved_stop_connections: int) -> None:
        limit = _descriptor_limit()
        self._low = limit - RESERVED_DESCRIPTORS
        self._none = self._low + reserved_stop_connections + CLOSING_DESCRIPTORS
        self._moves = self._low >= FIRST_CLIENT_DESCRIPTOR + CLIENT_DESCRIPTORS // 4

    def move_up(self, accepted: socket.socket) -> socket.socket:
        """The same connection with a descriptor that leaves the low ones to others, where there are enough."""
        if not self._moves:
            return accepted
        with accepted:
            descriptor = fcntl.fcntl(accepted.fileno(), fcntl.F_DUPFD_CLOEXEC, FIRST_CLIENT_DESCRIPTOR)
            moved = socket.socket(accepted.family, accepted.type, accepted.proto, fileno=descriptor)
            moved.setblocking(False)
            return moved

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
            # Accepted sockets inherit both: the bound on the requests that the kernel holds, and the size of a segment.
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
            listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_MAXSEG, SEGMENT_BYTES)
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


async def first_bytes(accepted: socket.socket, within_s: float | None) -> None:
    """Wait until a client of a protocol in which it speaks first has done so; closes the socket where it does not.

    Until then it costs a descriptor and little more: what TLS or HTTP hold for a client are hundreds of kilobytes.

    Raises:
        TimeoutError: it has said nothing ``within_s``.
    """
    loop = asyncio.get_running_loop()
    spoken = loop.create_future()
    loop.add_reader(accepted, _resolve, spoken)
    try:
        async with asyncio.timeout(within_s):
            await spoken
    except BaseException:
        loop.remove_reader(accepted)
        accepted.close()
        raise
    loop.remove_reader(accepted)


def _resolve(future: "asyncio.Future[None]") -> None:
    if not future.done():
        future.set_result(None)


ACCEPT_AGAIN_S = 0.1

log = structlog.get_logger(__name__)


class _AcceptQueue:
    """The clients that wait in the kernel at one listening socket, and the earliest time they can have arrived."""

    def __init__(self, listener: socket.socket, arrivals: Arrivals, unread: UnreadSockets) -> None:
        self._arrivals = arrivals
        self._oldest: ByteArrival | None = None
        self._poll = select.poll()
        self._poll.register(listener, select.POLLIN)
        unread.register(listener.fileno(), self)

    def mark_unread(self, arrival: ByteArrival) -> None:
        """A stop is carried out while a client waits."""
        self._oldest = self._oldest or arrival

    def next_arrival(self) -> ByteArrival:
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
        self._handshakes = ConnectionSlots[Session](MAX_HANDSHAKES)
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
                group.create_task(self._accept_connections(listener, group))

    def close(self) -> None:
        """Listen no more."""
        for listener in self._listeners:
            listener.close()

    async def _accept_connections(self, listener: socket.socket, group: asyncio.TaskGroup) -> None:
        loop, queue = asyncio.get_running_loop(), _AcceptQueue(listener, self._manager.arrivals, self._unread)
        while True:
            try:
                accepted, address = await loop.sock_accept(listener)
                accepted = self._descriptors.move_up(accepted)
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
            if handshake_timeout_s is not None:
                await first_bytes(accepted, handshake_timeout_s)
                self._begin_handshake(session, accepted)
            await asyncio.get_running_loop().connect_accepted_socket(
                lambda: SocketConnection(
                    self._manager, self._unread, session, accepted if self._tls is None else None
                ),
                accepted,
                ssl=self._tls,
                ssl_handshake_timeout=handshake_timeout_s,
            )
        except OSError as error:
            why = str(error) or NO_TLS
            self._log.warning("client_not_admitted", client=str(session), error=why)
            self._manager.remove(session)
        finally:
            self._handshakes.remove(session)

    def _begin_handshake(self, session: Session, accepted: socket.socket) -> None:
        """Raise ``ConnectionAbortedError`` where too many handshakes of this address are under way."""
        try:
            evicted = self._handshakes.add(session, session.host, self._manager.clock.now_s())
        except NoSlot as problem:
            accepted.close()
            raise ConnectionAbortedError(f"{problem} in their handshake") from None
        for gives_way in evicted:
            self._manager.disconnect(gives_way)


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
            self._announce_address()
            await self._listener.run()
        finally:
            self._listener.close()

    def _announce_address(self) -> None:
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
