"""Publish and subscribe by class: the class is the topic.

``publish`` never waits and never fails: every subscriber has an inbox of its own, bounded: in a full
one the oldest event gives way, and what gave way is counted.
"""

import asyncio
from collections import Counter, deque
from typing import Any, Generic, TypeVar

E = TypeVar("E")


class Inbox(Generic[E]):
    """The events that one subscriber has yet to take, in the order of their publication."""

    def __init__(
        self,
        bus: "Bus",
        topics: tuple[type[E], ...],
        size: int,
        kept: tuple[type[E], ...],
    ) -> None:
        if size < 1:
            raise ValueError(f"an inbox needs room for at least one event, got size {size}")
        if strangers := [topic.__name__ for topic in kept if topic not in topics]:
            raise ValueError(f"kept classes that are not subscribed to: {', '.join(strangers)}")
        self._bus, self._topics, self._size, self._kept = bus, topics, size, kept
        self._events: deque[E] = deque()
        self._waiter: asyncio.Future[None] | None = None
        self.dropped: Counter[type[Any]] = Counter()

    def __len__(self) -> int:
        return len(self._events)

    def put(self, event: E) -> None:
        """Add an event; in a full inbox the oldest gives way, and is counted."""
        events, waiter = self._events, self._waiter
        if len(events) == self._size and not self._make_room(event):
            self.dropped[type(event)] += 1
            return
        events.append(event)
        if waiter is not None and not waiter.done():
            waiter.set_result(None)

    def _make_room(self, newcomer: E) -> bool:
        """Drop the oldest event, but a kept one only for another kept one, and only where nothing else is left."""
        events, kept = self._events, self._kept
        spare = next((index for index, event in enumerate(events) if type(event) not in kept), None)
        if spare is None:
            if type(newcomer) not in kept:
                return False
            spare = 0
        self.dropped[type(events[spare])] += 1
        del events[spare]
        return True

    def take(self) -> E:
        """The oldest event, which must be there: raises ``IndexError`` on an empty inbox."""
        return self._events.popleft()

    async def get(self) -> E:
        """The oldest event; waits for one."""
        while not self._events:
            self._waiter = asyncio.get_running_loop().create_future()
            try:
                await self._waiter
            finally:
                self._waiter = None
        return self._events.popleft()

    async def get_within(self, timeout_s: float) -> E | None:
        """The oldest event, or None when none came within ``timeout_s``."""
        if self._events:
            return self._events.popleft()
        loop = asyncio.get_running_loop()
        self._waiter = waiter = loop.create_future()
        timer = loop.call_later(timeout_s, _expire, waiter)
        try:
            await waiter
        finally:
            timer.cancel()
            self._waiter = None
        return self._events.popleft() if self._events else None

    def __aiter__(self) -> "Inbox[E]":
        return self

    async def __anext__(self) -> E:
        return await self.get()

    def close(self) -> None:
        """Stop receiving; what is already inside can still be taken."""
        self._bus.unsubscribe(self)

    @property
    def topics(self) -> tuple[type[E], ...]:
        """The classes that this inbox receives."""
        return self._topics


def _expire(waiter: "asyncio.Future[None]") -> None:
    if not waiter.done():
        waiter.set_result(None)


class Bus:
    """Hands each published event to the inboxes subscribed to exactly its class."""

    def __init__(self) -> None:
        self._inboxes: dict[type[Any], tuple[Inbox[Any], ...]] = {}

    def subscribe(
        self,
        *topics: type[E],
        size: int = 256,
        kept: tuple[type[E], ...] = (),
    ) -> Inbox[E]:
        """An inbox for events of these classes; ``close`` it to unsubscribe.

        An event of a class in ``kept`` never gives way to one of another class: for what is rare and must be heard.

        Raises:
            ValueError: no topic was named, ``size`` is below 1, or ``kept`` cannot be.
        """
        if not topics:
            raise ValueError("subscribe needs at least one event class")
        inbox = Inbox(self, topics, size, kept)
        for topic in topics:
            self._inboxes[topic] = (*self._inboxes.get(topic, ()), inbox)
        return inbox

    def unsubscribe(self, inbox: Inbox[Any]) -> None:
        """Take an inbox off the bus; doing it twice is harmless."""
        for topic in inbox.topics:
            self._inboxes[topic] = tuple(i for i in self._inboxes.get(topic, ()) if i is not inbox)

    def publish(self, event: object) -> None:
        """Put the event into every inbox of its class, at once."""
        for inbox in self._inboxes.get(type(event), ()):
            inbox.put(event)

    def wanted(self, topic: type[Any]) -> bool:
        """Whether anyone listens: lets a publisher skip making an event that nobody takes."""
        return bool(self._inboxes.get(topic))

    def drops(self) -> dict[str, int]:
        """Events given up so far, by class name, over all present inboxes."""
        inboxes = {id(i): i for group in self._inboxes.values() for i in group}
        total: Counter[str] = Counter()
        for inbox in inboxes.values():
            total.update({topic.__name__: n for topic, n in inbox.dropped.items()})
        return dict(total)
