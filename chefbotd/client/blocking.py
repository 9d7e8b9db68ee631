"""Blocking versions of the asyncio client's methods."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

from chefbotd.client.client import Client
from chefbotd.client.subscription import Subscription
from chefbotd.client.sync_subscription import SyncSubscription

if TYPE_CHECKING:
    from chefbotd.client.background import BackgroundLoop
    from chefbotd.client.models import TopicData

P = ParamSpec("P")
T = TypeVar("T")
D = TypeVar("D", bound="TopicData")


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
