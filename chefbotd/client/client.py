"""The asyncio client: one method per method of the socket.

    async with Client.connect() as robot:
        await robot.wait_until_armed()
        await robot.drive_for(2.0, linear_m_s=0.2)
        print((await robot.get_state()).odometry.x_m)

Every error is a ``ChefbotError``.
"""

import asyncio
import contextlib
import ssl
import weakref
from collections import Counter
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from typing import Any, Self, Unpack

from chefbotd.client.errors import (
    CallTimeout,
    ChefbotError,
    ConnectionLost,
    ProtocolError,
    SubscriptionConflict,
)
from chefbotd.client.event import Event, Gap
from chefbotd.client.generated import ComponentMethods, Topics
from chefbotd.client.handshake import (
    CLOSING_PATIENCE_S,
    RECOVERABLE,
    DaemonGreeting,
    Endpoint,
    GreetedConnection,
    open_connection,
)
from chefbotd.client.methods import Methods
from chefbotd.client.sleep_watch import SleepWatch
from chefbotd.client.subscription import SubscribeOptions, Subscription, SubscriptionRequest
from chefbotd.client.wire import ProgressListener

FIRST_RETRY_PAUSE_S, LONGEST_RETRY_PAUSE_S = 0.1, 2.0


class Client(Methods, ComponentMethods, Topics):
    """A connected daemon; made by ``connect``. ``hello`` is its latest greeting."""

    def __init__(self, endpoint: Endpoint, *, reconnect: bool) -> None:
        self._endpoint, self._reconnect = endpoint, reconnect
        self._subscriptions: weakref.WeakSet[Subscription[Any]] = weakref.WeakSet()
        self._connection: GreetedConnection
        self._reconnecting: asyncio.Task[None] | None = None
        self._connected_again = asyncio.Event()
        self._closing = False
        self._loop = asyncio.get_running_loop()
        self._sleep_watch = SleepWatch()
        self.dropped: Counter[str] = Counter()

    @classmethod
    @asynccontextmanager
    async def connect(
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
    ) -> AsyncIterator[Self]:
        """Connect, wait for the greeting, show the token if one is asked for, and say our name if we have one.

        ``tls`` decides which certificates are trusted (``ssl.create_default_context(cafile=...)``); without it the
        connection is not encrypted. ``timeout_s`` also bounds every later call. When the block ends, the daemon
        withdraws what this client drove with: the robot brakes, unless another source drives it.

        ``clear_token`` says whether the token may go to another computer without TLS; None: it goes, and is warned of.

        With ``reconnect`` a lost connection is opened again, and subscriptions go on; the first event of each topic
        has the ``gap``. Calls are never repeated: those under way, and those made meanwhile, raise ``ConnectionLost``.

        Raises:
            CannotConnect: nobody listens there, or it is not whom we trust.
            CallError: the daemon wants another token (``kind`` is ``wrong_token``).
            NoGreeting: the connection was closed, or stayed silent, before the greeting.
            ConnectionLost: the same, and it was said why.
            IncompatibleProtocol: the daemon speaks another major version.
            TokenWithheld: the connection is not encrypted, and ``clear_token`` is False.
        """
        client = cls(Endpoint(host, port, token, tls, name, timeout_s, clear_token), reconnect=reconnect)
        client._connection = await open_connection(client._endpoint, client._notified, client._lost)
        client._connected_again.set()
        try:
            yield client
        finally:
            await client._close()

    async def _close(self) -> None:
        self._closing = True
        self._sleep_watch.stop()
        if self._reconnecting is not None:
            self._reconnecting.cancel()
            await asyncio.gather(self._reconnecting, return_exceptions=True)
        await self._connection.wire.close(CLOSING_PATIENCE_S)
        self._end_all(ConnectionLost("the client is closed"))

    @property
    def hello(self) -> DaemonGreeting:
        """The daemon's latest greeting; ``session`` changes when the daemon restarts."""
        return self._connection.hello

    @property
    def address(self) -> tuple[str, int]:
        """The host and the port of the daemon."""
        return self._endpoint.host, self._endpoint.port

    @property
    def connected(self) -> bool:
        """Whether the connection stands."""
        return self._connection.wire.lost is None

    async def wait_until_connected(self, timeout_s: float = 10.0) -> None:
        """Wait for the connection to stand again, with ``reconnect``.

        Raises:
            CallTimeout: it does not within ``timeout_s`` seconds.
            ConnectionLost: it is lost for good.
        """
        if not self.connected and not self._reconnect:
            raise ConnectionLost(str(self._connection.wire.lost))
        try:
            async with asyncio.timeout(timeout_s):
                await self._connected_again.wait()
        except TimeoutError:
            raise CallTimeout(f"no connection again within {timeout_s:g} s") from None
        if not self.connected:
            raise ConnectionLost(str(self._connection.wire.lost))

    async def call(
        self, method: str, /, *, on_progress: ProgressListener | None = None, **params: Any
    ) -> dict[str, Any]:
        """Any method by its name: the answer's ``result`` as it came.

        ``on_progress`` is called with each report of a request that takes its time: done, total, text. Cancelling the
        task that waits cancels the request.
        """
        return await self._connection.wire.call(method, params, self._endpoint.timeout_s, on_progress)

    # telemetry

    def _subscription(
        self, topics: str | Iterable[str], **options: Unpack[SubscribeOptions]
    ) -> Subscription[Any]:
        names = (topics,) if isinstance(topics, str) else tuple(topics)
        request = SubscriptionRequest(names, options.get("max_rate_hz"), options.get("policy", "latest"))
        subscription: Subscription[Any] = Subscription(
            request, options.get("queue_size", 256), self._subscribe, self._unsubscribe
        )
        # one that nobody holds any more, after a break out of its loop, has been left
        weakref.finalize(
            subscription, _call_on_loop, self._loop, weakref.WeakMethod(self._drop_topics), names
        )
        return subscription

    async def _subscribe(self, subscription: Subscription[Any]) -> None:
        import chefbotd.client.state  # noqa: F401 - the models, before there are events to parse

        for other in list(self._subscriptions):
            if problem := subscription.request.conflict(other.request):
                raise SubscriptionConflict(problem)
        self._subscriptions.add(subscription)  # first: the snapshot follows the answer at once
        try:
            await self.call("subscribe", **subscription.request.params())
        except BaseException:
            self._subscriptions.discard(subscription)
            self._drop_topics(subscription.topics)
            raise

    async def _unsubscribe(self, subscription: Subscription[Any]) -> None:
        self._subscriptions.discard(subscription)
        if over := self._topics_without_subscriber(subscription.topics):
            with contextlib.suppress(ConnectionLost):  # then it is over all the same
                await self.call("unsubscribe", topics=over)

    def _drop_topics(self, topics: tuple[str, ...]) -> None:
        """Somebody has gone without a word."""
        if over := self._topics_without_subscriber(topics):
            self._connection.wire.notify("unsubscribe", {"topics": over})

    def _topics_without_subscriber(self, topics: tuple[str, ...]) -> list[str]:
        subscribed = {topic for other in list(self._subscriptions) for topic in other.topics}
        return [topic for topic in topics if topic not in subscribed]

    def _notified(self, method: str, params: dict[str, Any]) -> None:
        if method == "event":
            self._take_event(params)
        elif method == "dropped":
            self._count_drops(params)

    def _take_event(self, params: dict[str, Any]) -> None:
        topic = params.get("topic")
        receivers = [s for s in list(self._subscriptions) if topic in s.topics]
        if not receivers:
            return
        from chefbotd.client.state import parse_event  # loaded when it was subscribed

        event: Event[Any] | ProtocolError
        try:
            event = parse_event(params)
        except ProtocolError as problem:
            event = problem
        for subscription in receivers:
            subscription.put(event)

    def _count_drops(self, params: dict[str, Any]) -> None:
        topics: dict[str, int] = params["topics"]
        self.dropped.update(topics)
        for subscription in list(self._subscriptions):
            subscription.dropped.update({t: n for t, n in topics.items() if t in subscription.topics})

    # losing the connection, and finding it again

    def _lost(self, loss: ConnectionLost) -> None:
        self._connected_again.clear()
        if self._closing or not self._reconnect:
            self._end_all(loss)
        elif self._reconnecting is None:
            self._reconnecting = asyncio.create_task(self._reconnect_until_connected(loss))

    def _end_all(self, failure: ChefbotError) -> None:
        for subscription in list(self._subscriptions):
            subscription.end(failure)
        self._subscriptions.clear()
        self._connected_again.set()

    async def _reconnect_until_connected(self, loss: ConnectionLost) -> None:
        """Connect again until it stands, and have every open subscription go on."""
        began_s, pause_s = self._loop.time(), FIRST_RETRY_PAUSE_S
        try:
            while not await self._try_to_reconnect(loss, began_s):
                await asyncio.sleep(pause_s)
                pause_s = min(2 * pause_s, LONGEST_RETRY_PAUSE_S)
            self._connected_again.set()
        except ChefbotError as failure:  # trying again would not help
            self._end_all(failure)
        finally:
            self._reconnecting = None

    async def _try_to_reconnect(self, loss: ConnectionLost, began_s: float) -> bool:
        session = self._connection.hello.session
        try:
            self._connection = await open_connection(self._endpoint, self._notified, self._lost)
            restarted = self._connection.hello.session != session
            gap = Gap(str(loss), self._loop.time() - began_s, restarted)
            for subscription in list(self._subscriptions):
                subscription.resume(gap)
                await self.call("subscribe", **subscription.request.params())
        except RECOVERABLE:
            return False
        return self.connected


def _call_on_loop(
    loop: asyncio.AbstractEventLoop, method: "weakref.WeakMethod[Any]", topics: tuple[str, ...]
) -> None:
    """May run in any thread: the garbage collector chooses it."""
    bound = method()
    if bound is not None and not loop.is_closed():
        with contextlib.suppress(RuntimeError):  # closed in this very moment
            loop.call_soon_threadsafe(bound, topics)
