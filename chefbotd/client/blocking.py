"""Runs the asyncio client in a thread of its own: blocking versions of its methods, telemetry as an iterator."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import threading
from collections import Counter
from collections.abc import Callable, Coroutine, Iterator
from functools import wraps
from types import TracebackType
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, Self, TypeVar

from chefbotd.client.client import Client
from chefbotd.client.errors import ConnectionLost
from chefbotd.client.event import Event
from chefbotd.client.subscription import Subscription

if TYPE_CHECKING:
    from chefbotd.rpc.encoding import Sent

if TYPE_CHECKING:
    from chefbotd.rpc.encoding import Sent


T = TypeVar("T")
FLUSH_TIMEOUT_S = 2.0
"""For work that is interrupted, such as driving, which brakes first."""

CLOSED = "the client is closed"


class BackgroundLoop:
    """Runs coroutines for other threads. Its own thread does not keep the interpreter alive."""

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._closing = False
        self._handing_over = threading.Lock()  # whatever is handed over before the end is begun before it
        self._thread = threading.Thread(target=self._loop.run_forever, name="chefbotd-client", daemon=True)
        self._thread.start()

    @property
    def closed(self) -> bool:
        """Whether nothing more is begun here."""
        return self._closing

    def run(self, work: Coroutine[Any, Any, T]) -> T:
        """The coroutine's result. When the waiting is interrupted (Ctrl-C), the work is cancelled, and its end awaited.

        Raises:
            ConnectionLost: the loop is closed.
        """
        done: concurrent.futures.Future[T] = concurrent.futures.Future()
        tasks: list[asyncio.Task[T]] = []

        def begin() -> None:
            tasks.append(self._loop.create_task(work))
            tasks[0].add_done_callback(lambda task: _settle(done, task))

        with self._handing_over:
            if self._closing:
                work.close()
                raise ConnectionLost(CLOSED)
            self._loop.call_soon_threadsafe(begin)
        try:
            return done.result()
        except asyncio.CancelledError:
            raise ConnectionLost(CLOSED) from None
        except BaseException:
            if not done.done():
                with contextlib.suppress(RuntimeError):  # the loop is closed: the work was cancelled
                    self._loop.call_soon_threadsafe(lambda: tasks[0].cancel())
                concurrent.futures.wait([done], timeout=FLUSH_TIMEOUT_S)
            raise

    def close(self) -> None:
        """Cancel what still runs, and end the thread; doing it twice is harmless."""
        with self._handing_over:
            if self._closing:
                return
            self._closing = True
            self._loop.call_soon_threadsafe(self._end)
        self._thread.join()
        self._loop.close()

    def _end(self) -> None:
        ending = self._loop.create_task(_cancel_others())
        ending.add_done_callback(lambda _: self._loop.stop())


async def _cancel_others() -> None:
    others = asyncio.all_tasks() - {asyncio.current_task()}
    for task in others:
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)


def _settle(done: concurrent.futures.Future[T], task: asyncio.Task[T]) -> None:
    if task.cancelled():
        done.set_exception(asyncio.CancelledError())
    elif (error := task.exception()) is not None:
        done.set_exception(error)
    else:
        done.set_result(task.result())


D = TypeVar("D", bound="Sent")


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


P = ParamSpec("P")


class InBackground:
    """Has an asyncio client, and the loop that it runs on."""

    _loop: BackgroundLoop
    _client: Client


def blocking(
    method: Callable[Concatenate[Client, P], Coroutine[Any, Any, T]],
) -> Callable[Concatenate[InBackground, P], T]:
    """The method as a plain one."""

    @wraps(method)
    def call(self: InBackground, /, *args: P.args, **kwargs: P.kwargs) -> T:
        return self._loop.run(method(self._client, *args, **kwargs))

    return call


def blocking_subscription(
    method: Callable[Concatenate[Client, P], Subscription[D]],
) -> Callable[Concatenate[InBackground, P], SyncSubscription[D]]:
    """The same for a method that makes a subscription; each of its overloads stays one."""

    @wraps(method)
    def subscribe(self: InBackground, /, *args: P.args, **kwargs: P.kwargs) -> SyncSubscription[D]:
        async def make() -> Subscription[D]:
            return method(self._client, *args, **kwargs)

        return SyncSubscription(self._loop, self._loop.run(make()))

    return subscribe
