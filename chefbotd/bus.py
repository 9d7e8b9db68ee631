"""Publish and subscribe by class: the class is the topic.

``publish`` never waits and never fails. A subscriber either has an inbox of its own, from which it takes events in
its own time, or a handler that is called at once. Inboxes are bounded: in a full one the oldest event gives way, and is
counted.
A handler that raises harms neither the publisher nor the other subscribers: its error is counted, and is logged or
handed to whoever answers for the handler.
"""

import asyncio
from collections import Counter, deque
from collections.abc import Callable
from typing import Any, Generic, NoReturn, TypeAlias, TypeVar

import structlog

E = TypeVar("E")
Handler = Callable[[Any], None]
OnError = Callable[[Exception], None]

log = structlog.get_logger(component="bus")


class Inbox(Generic[E]):
    """The events that one subscriber has yet to take, in the order of their publication."""

    def __init__(
        self,
        bus: "Bus",
        topics: tuple[type[E], ...],
        size: int,
        kept: tuple[type[E], ...],
        excluded: frozenset[str] = frozenset(),
    ) -> None:
        if size < 1:
            raise ValueError(f"an inbox needs room for at least one event, got size {size}")
        if unknown := [topic.__name__ for topic in kept if topic not in topics]:
            raise ValueError(f"kept classes that are not subscribed to: {', '.join(unknown)}")
        self._bus, self._size, self._kept, self.excluded = bus, size, kept, excluded
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

    def take_all(self) -> list[E]:
        """Every event that is there, from the oldest to the newest."""
        events = list(self._events)
        self._events.clear()
        return events

    def take_some(self, most: int) -> list[E]:
        """The oldest events, ``most`` of them at most."""
        events = self._events
        if len(events) <= most:
            return self.take_all()
        return [events.popleft() for _ in range(most)]

    async def next_put(self) -> None:
        """Wait until one more event is put in, whatever is inside already."""
        self._waiter = asyncio.get_running_loop().create_future()
        try:
            await self._waiter
        finally:
            self._waiter = None

    def take_event(self) -> E:
        """The oldest event, which must be there: raises ``IndexError`` on an empty inbox."""
        return self._events.popleft()

    async def get(self) -> E:
        """The oldest event; waits for one."""
        while not self._events:
            await self.next_put()
        return self._events.popleft()

    def __aiter__(self) -> "Inbox[E]":
        return self

    async def __anext__(self) -> E:
        return await self.get()

    def close(self) -> None:
        """Stop receiving; what is already inside can still be taken."""
        self._bus.unsubscribe(self)


def _expire(waiter: "asyncio.Future[None]") -> None:
    if not waiter.done():
        waiter.set_result(None)


Route: TypeAlias = tuple[tuple[Inbox[Any], ...], tuple[Handler, ...]]
"""Who takes a class of events: the inboxes, and the handlers."""

NOBODY: Route = ((), ())


class Bus:
    """Hands each published event to the subscribers of exactly its class, and to those of all events.

    ``handler_errors`` counts the handlers that raised, by the name of the event's class.
    """

    def __init__(self) -> None:
        self._inboxes: dict[type[Any], tuple[Inbox[Any], ...]] = {}
        self._of_all: tuple[Inbox[Any], ...] = ()
        self._handlers: dict[type[Any], tuple[tuple[Handler, OnError], ...]] = {}
        self._routes: dict[type[Any], Route] = {}
        self._undelivered: list[tuple[object, tuple[Handler, ...]]] = []
        self._is_held = False
        self.handler_errors: Counter[str] = Counter()

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
            self._inboxes[topic] = (*self._inboxes_of(topic), inbox)
        self._forget_routes()
        return inbox

    def subscribe_all(self, size: int, excluded: frozenset[str] = frozenset()) -> Inbox[Any]:
        """An inbox for every event but those of classes with ``excluded`` names; ``close`` it to unsubscribe."""
        inbox: Inbox[Any] = Inbox(self, (), size, (), excluded)
        self._of_all = (*self._of_all, inbox)
        self._inboxes = {
            topic: inboxes if topic.__name__ in excluded else (*inboxes, inbox)
            for topic, inboxes in self._inboxes.items()
        }
        self._forget_routes()
        return inbox

    def unsubscribe(self, inbox: Inbox[Any]) -> None:
        """Take an inbox off the bus; doing it twice is harmless."""
        self._of_all = _without(inbox, self._of_all)
        self._inboxes = {topic: _without(inbox, inboxes) for topic, inboxes in self._inboxes.items()}
        self._forget_routes()

    def add_handler(
        self, handler: Callable[[E], None], *topics: type[E], on_error: OnError | None = None
    ) -> Callable[[], None]:
        """Call ``handler`` with each event of these classes, before ``publish`` returns; returns what removes it.

        Events that a handler publishes are handed on after the present one, so that every handler gets events in the
        order of their publication. ``on_error`` is called with what the handler raises; without one it is logged.

        Raises:
            ValueError: no topic was named.
        """
        if not topics:
            raise ValueError("add_handler needs at least one event class")
        entry = (handler, on_error or _log_error)
        for topic in topics:
            self._handlers[topic] = (*self._handlers.get(topic, ()), entry)
        self._forget_routes()

        def remove() -> None:
            for topic in topics:
                self._handlers[topic] = _without(entry, self._handlers[topic])
            self._forget_routes()

        return remove

    def publish(self, event: object) -> None:
        """Put the event into every inbox of its class, and call every handler of its class."""
        topic = type(event)
        try:
            inboxes, handlers = self._routes[topic]
        except KeyError:
            inboxes, handlers = self._find_route(topic)
        for inbox in inboxes:
            inbox.put(event)
        if handlers:
            self._undelivered.append((event, handlers))
            if not self._is_held:
                self.deliver()

    def hold(self) -> None:
        """Keep what is published from its handlers until ``deliver``: for events that belong together."""
        self._is_held = True

    def deliver(self) -> None:
        """Call the handlers of all that was published meanwhile, and of what they publish, in that order."""
        self._is_held = True
        try:
            for event, handlers in self._undelivered:  # it grows meanwhile
                for handler in handlers:
                    try:
                        handler(event)
                    except Exception as error:  # noqa: BLE001 (handed on)
                        self._report_error(event, error, handler)
        finally:
            self._undelivered.clear()
            self._is_held = False

    def _report_error(self, event: object, error: Exception, failed: Handler) -> None:
        self.handler_errors[type(event).__name__] += 1
        entries = self._handlers.get(type(event), ())
        on_error = next((on_error for handler, on_error in entries if handler is failed), _log_error)
        try:
            on_error(error)
        except Exception as another:  # noqa: BLE001 (logged)
            _log_error(another)

    def has_listeners(self, topic: type[Any]) -> bool:
        """Whether anyone listens: lets a publisher skip making an event that nobody takes."""
        try:
            return self._routes[topic] is not NOBODY
        except KeyError:
            return self._find_route(topic) is not NOBODY

    def _find_route(self, topic: type[Any]) -> Route:
        """Note who takes a class, until somebody comes or goes: events are published far more often."""
        route = self._inboxes_of(topic), tuple([handler for handler, _ in self._handlers.get(topic, ())])
        route = self._routes[topic] = route if any(route) else NOBODY
        return route

    def _forget_routes(self) -> None:
        """Somebody came or went: what waits goes to those who are there now, too."""
        self._routes.clear()
        self._undelivered[:] = [(event, self._find_route(type(event))[1]) for event, _ in self._undelivered]

    def _inboxes_of(self, topic: type[Any]) -> tuple[Inbox[Any], ...]:
        inboxes = self._inboxes.get(topic)
        if inboxes is not None:
            return inboxes
        return tuple(inbox for inbox in self._of_all if topic.__name__ not in inbox.excluded)

    def drops(self) -> dict[str, int]:
        """Events given up so far, by class name, over all present inboxes."""
        inboxes = {id(i): i for group in (*self._inboxes.values(), self._of_all) for i in group}
        total: Counter[str] = Counter()
        for inbox in inboxes.values():
            total.update({topic.__name__: n for topic, n in inbox.dropped.items()})
        return dict(total)


T = TypeVar("T")


def _without(subscriber: T, subscribers: tuple[T, ...]) -> tuple[T, ...]:
    return tuple(other for other in subscribers if other is not subscriber)


def _log_error(error: Exception) -> None:
    log.error("an event handler has failed", error=repr(error), exc_info=error)


class HandlerFailure:
    """Carries the error of a service's handler to the service's ``run``, and so to whoever supervises it."""

    def __init__(self) -> None:
        self._error: Exception | None = None
        self._waiter: asyncio.Future[None] | None = None

    def report(self, error: Exception) -> None:
        """A handler has failed; of several failures before ``wait`` returns the first counts."""
        if self._error is None:
            self._error = error
        if self._waiter is not None:
            _expire(self._waiter)

    async def wait(self) -> NoReturn:
        """Wait for a failure, or for one that was reported before, and raise it."""
        while self._error is None:
            self._waiter = asyncio.get_running_loop().create_future()
            try:
                await self._waiter
            finally:
                self._waiter = None
        error, self._error = self._error, None
        raise error
