"""The client without asyncio, for scripts and notebooks: the same names, plain calls.

    with SyncClient.connect() as robot:
        robot.wait_until_armed()
        robot.drive_for(2.0, linear_m_s=0.2)
        print(robot.get_state().odometry.x_m)

It runs the asyncio client in a thread of its own.
"""

from __future__ import annotations

import ssl
from collections import Counter
from contextlib import AsyncExitStack
from types import TracebackType
from typing import Self

from chefbotd.client.blocking import BackgroundLoop
from chefbotd.client.client import Client
from chefbotd.client.errors import ConnectionLost
from chefbotd.client.generated_sync import SyncMethods
from chefbotd.client.handshake import DaemonGreeting


class SyncClient(SyncMethods):
    """A connected daemon; made by ``connect``. Every method is ``Client``'s of the same name, and raises the same.

    ``on_progress`` is called in another thread. Ctrl-C cancels what is waited for: ``drive_for`` brakes, goals end.
    It may be used from several threads. Close it, or use it as ``with SyncClient.connect() as robot``.
    """

    def __init__(self, loop: BackgroundLoop, client: Client, stack: AsyncExitStack) -> None:
        self._loop, self._client, self._stack = loop, client, stack

    @classmethod
    def connect(
        cls,
        host: str = "127.0.0.1",
        port: int = 7333,
        *,
        token: str | None = None,
        tls: ssl.SSLContext | None = None,
        name: str | None = None,
        timeout_s: float = 5.0,
        reconnect: bool = False,
        clear_token: bool | None = None,
    ) -> Self:
        """Connect at once; the parameters are those of ``Client.connect``."""
        loop, stack = BackgroundLoop(), AsyncExitStack()

        async def enter() -> Client:
            meeting = Client.connect(
                host,
                port,
                token=token,
                tls=tls,
                name=name,
                timeout_s=timeout_s,
                reconnect=reconnect,
                clear_token=clear_token,
            )
            return await stack.enter_async_context(meeting)

        try:
            return cls(loop, loop.run(enter()), stack)
        except BaseException:
            loop.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect: the daemon withdraws what this client drove with. Doing it twice is harmless."""
        if not self._loop.closed:
            try:
                self._loop.run(self._stack.aclose())
            except ConnectionLost:
                if not self._loop.closed:  # else another thread was first
                    raise
            finally:
                self._loop.close()

    @property
    def hello(self) -> DaemonGreeting:
        """The daemon's latest greeting."""
        return self._client.hello

    @property
    def connected(self) -> bool:
        """Whether the connection stands."""
        return self._client.connected and not self._loop.closed

    @property
    def dropped(self) -> Counter[str]:
        """Events that the daemon gave up for this connection, by topic."""
        return self._client.dropped
