"""The TCP socket of the RPC server."""

import asyncio
import ssl

import structlog

from chefbotd.rpc.parameters import ApiParameters, is_loopback
from chefbotd.rpc.server import RpcServer
from chefbotd.transport.tcp.listener import Listener
from chefbotd.transport.unread import UnreadSockets

log = structlog.get_logger(__name__)


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
