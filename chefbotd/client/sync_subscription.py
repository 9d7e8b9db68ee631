"""Telemetry as a plain iterator, for the synchronous client."""

from collections import Counter
from collections.abc import Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Generic, Self, TypeVar

from chefbotd.client.background import BackgroundLoop
from chefbotd.client.event import Event
from chefbotd.client.subscription import Subscription

if TYPE_CHECKING:
    from chefbotd.client.models import TopicData

D = TypeVar("D", bound="TopicData")


class SyncSubscription(Iterator[Event[D]], Generic[D]):
    """The events of some topics: iterate, or ask for the ``next``; ``dropped`` counts, by topic, what was lost.

    Iterating waits for as long as nothing comes; raises ``ConnectionLost`` when the connection goes down.
    """

    def __init__(self, loop: BackgroundLoop, subscription: Subscription[D]) -> None:
        self._loop, self._subscription = loop, subscription

    @property
    def dropped(self) -> Counter[str]:
        """Events that this reader was too slow for."""
        return self._subscription.dropped

    def __enter__(self) -> Self:
        self._loop.run(self._subscription.__aenter__())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __next__(self) -> Event[D]:
        event = self._loop.run(_next_or_none(self._subscription))
        if event is None:
            raise StopIteration
        return event

    def next(self, timeout_s: float) -> Event[D]:
        """The next event; raises ``CallTimeout`` when none comes within ``timeout_s`` seconds."""
        return self._loop.run(self._subscription.next(timeout_s))

    def close(self) -> None:
        """Tell the daemon to stop; doing it twice is harmless."""
        self._loop.run(self._subscription.close())


async def _next_or_none(subscription: Subscription[D]) -> Event[D] | None:
    return await anext(subscription, None)  # StopIteration does not pass through a future
