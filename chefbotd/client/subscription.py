"""Telemetry as an asynchronous iterator, bounded: a slow reader loses the oldest, and sees how many."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

from chefbotd.client.errors import ConnectionLost


@dataclass(frozen=True, slots=True)
class Event:
    """One telemetry object: counted by topic, stamped by the daemon's clock, ``age_s`` old when sent."""

    topic: str
    seq: int
    stamp_s: float
    age_s: float
    data: dict[str, Any]


class Subscription(AsyncIterator[Event]):
    """The events of some topics; asked of the daemon on ``async with`` or at the first ``async for``.

    ``dropped`` counts, by topic, the events that this reader was too slow for: those that the daemon gave up
    for this connection, and those that fell out of the full queue here. Iterating raises ``ConnectionLost``
    when the connection goes down, and ends after ``close``.
    """

    def __init__(
        self,
        topics: tuple[str, ...],
        queue_size: int,
        start: Callable[["Subscription"], Awaitable[None]],
        stop: Callable[["Subscription"], Awaitable[None]],
    ) -> None:
        if queue_size < 1:
            raise ValueError(f"queue_size must be >= 1, got {queue_size}")
        self.topics = topics
        self.dropped: Counter[str] = Counter()
        self._queue: asyncio.Queue[Event | None] = asyncio.Queue()
        self._queue_size, self._start, self._stop = queue_size, start, stop
        self._started = self._ended = False
        self._loss: ConnectionLost | None = None

    def put(self, event: Event) -> None:
        """Add an event (the client's part); the oldest gives way when the queue is full."""
        if self._queue.qsize() >= self._queue_size:
            oldest = self._queue.get_nowait()
            self.dropped[oldest.topic if oldest else event.topic] += 1
        self._queue.put_nowait(event)

    def end(self, loss: ConnectionLost | None = None) -> None:
        """No more events will come; those already here can still be taken."""
        self._ended, self._loss = True, loss
        self._queue.put_nowait(None)

    async def __aenter__(self) -> Self:
        await self._ensure_started()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def __anext__(self) -> Event:
        await self._ensure_started()
        event = None if self._ended and self._queue.empty() else await self._queue.get()
        if event is not None:
            return event
        if self._loss is not None:
            raise ConnectionLost(str(self._loss))
        raise StopAsyncIteration

    async def close(self) -> None:
        """Tell the daemon to stop, unless the connection is already gone; doing it twice is harmless."""
        if self._started and not self._ended:
            self.end()
            await self._stop(self)

    async def _ensure_started(self) -> None:
        if not self._started:
            await self._start(self)
            self._started = True
