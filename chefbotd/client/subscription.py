"""Telemetry as an asynchronous iterator, bounded: a slow reader loses the oldest events, which are counted."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable
from types import TracebackType
from typing import TYPE_CHECKING, Any, Generic, Literal, Self, TypedDict, TypeVar

from chefbotd.client.errors import CallTimeout, ChefbotError, ConnectionLost
from chefbotd.client.event import Event, Gap
from chefbotd.core.record import Record, replace

if TYPE_CHECKING:
    from chefbotd.rpc.encoding import Sent

D = TypeVar("D", bound="Sent")
Policy = Literal["latest", "ordered"]


class SubscribeOptions(TypedDict, total=False):
    """How a subscription is served.

    ``max_rate_hz``: at most so many events a second of each topic (default: all).
    ``policy``: what a connection that is too slow loses, see docs/api.md (default ``latest``).
    ``queue_size``: how many events wait here for a slow reader; 1 for the freshest only (default 256).
    """

    max_rate_hz: float | None
    policy: Policy
    queue_size: int


class SubscriptionRequest(Record, frozen=True):
    """What is asked of the daemon."""

    topics: tuple[str, ...]
    max_rate_hz: float | None = None
    policy: Policy = "latest"

    def params(self) -> dict[str, Any]:
        """The parameters of ``subscribe``."""
        rate = {} if self.max_rate_hz is None else {"max_rate_hz": self.max_rate_hz}
        return {"topics": self.topics, "policy": self.policy, **rate}

    def conflict(self, other: "SubscriptionRequest") -> str | None:
        """Why the two cannot share a connection: the daemon keeps one rate and policy for a topic of it."""
        shared = [topic for topic in self.topics if topic in other.topics]
        if not shared or (self.max_rate_hz, self.policy) == (other.max_rate_hz, other.policy):
            return None
        rate = "all events" if other.max_rate_hz is None else f"at most {other.max_rate_hz:g} events/s"
        return (
            f"{shared[0]} is subscribed on this client already, with {rate} and policy {other.policy}: "
            "use the same, close that subscription first, or connect another client"
        )


class Subscription(AsyncIterator[Event[D]], Generic[D]):
    """The events of some topics; asked of the daemon on ``async with`` or at the first ``async for``.

    ``dropped`` counts, by topic, the events that this reader was too slow for: those that the daemon gave up
    for this connection, and those that fell out of the full queue here. Iterating raises ``ConnectionLost``
    when the connection goes down for good, and ends after ``close``.
    """

    def __init__(
        self,
        request: SubscriptionRequest,
        queue_size: int,
        start: Callable[["Subscription[Any]"], Awaitable[None]],
        stop: Callable[["Subscription[Any]"], Awaitable[None]],
    ) -> None:
        if queue_size < 1:
            raise ValueError(f"queue_size must be >= 1, got {queue_size}")
        self.request, self.topics = request, request.topics
        self.dropped: Counter[str] = Counter()
        self._queue: asyncio.Queue[Event[D] | ChefbotError | None] = asyncio.Queue()
        self._queue_size, self._start, self._stop = queue_size, start, stop
        self._starting = asyncio.Lock()
        self._started = self._ended = False
        self._failure: ChefbotError | None = None
        self._seqs: dict[str, int] = {}
        self._gaps: dict[str, Gap] = {}

    def put(self, event: Event[D] | ChefbotError) -> None:
        """Add an event, or what came instead of one (the client's part); the oldest gives way when there is no room.

        The latest value of a topic comes again when another subscription begins; it is not told twice.
        """
        if isinstance(event, Event):
            if self._seqs.get(event.topic) == event.seq and event.topic not in self._gaps:
                return
            self._seqs[event.topic] = event.seq
        if self._queue.qsize() >= self._queue_size:
            self._give_up(self._queue.get_nowait())
        if isinstance(event, Event) and event.topic in self._gaps:
            event = replace(event, gap=self._gaps.pop(event.topic))
        self._queue.put_nowait(event)

    def _give_up(self, oldest: Event[D] | ChefbotError | None) -> None:
        if isinstance(oldest, Event):
            self.dropped[oldest.topic] += 1
            if oldest.gap is not None:
                self._gaps.setdefault(oldest.topic, oldest.gap)

    def resume(self, gap: Gap) -> None:
        """Events come again after a reconnection (the client's part)."""
        self._gaps = dict.fromkeys(self.topics, gap)

    def end(self, failure: ChefbotError | None = None) -> None:
        """No more events will come; those already here can still be taken."""
        self._ended, self._failure = True, failure
        self._queue.put_nowait(None)

    async def __aenter__(self) -> Self:
        await self._ensure_started()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def __anext__(self) -> Event[D]:
        await self._ensure_started()
        event = None if self._ended and self._queue.empty() else await self._queue.get()
        if isinstance(event, Event):
            return event
        if event is not None:
            raise event
        self._queue.put_nowait(None)  # for whoever else waits
        if self._failure is not None:
            raise self._failure.with_traceback(None)
        raise StopAsyncIteration

    async def next(self, timeout_s: float) -> Event[D]:
        """The next event.

        Raises:
            CallTimeout: none came within ``timeout_s`` seconds.
            ConnectionLost: the connection went down, or the subscription is closed.
        """
        try:
            async with asyncio.timeout(timeout_s):
                return await anext(self)
        except TimeoutError:
            raise CallTimeout(f"no event of {', '.join(self.topics)} within {timeout_s:g} s") from None
        except StopAsyncIteration:
            raise ConnectionLost("the subscription is closed") from None

    async def close(self) -> None:
        """Tell the daemon to stop, unless the connection is already gone; doing it twice is harmless."""
        if self._started and not self._ended:
            self.end()
            await self._stop(self)

    async def _ensure_started(self) -> None:
        async with self._starting:
            if not self._started:
                await self._start(self)
                self._started = True
