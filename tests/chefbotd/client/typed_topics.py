"""Writes ``client/topics.py``, which types ``subscribe`` by the name of each topic: ``make topics``."""

from pathlib import Path

import chefbotd.client.topics
from chefbotd.client.models import DATA_BY_TOPIC

HEAD = '''"""What a subscription to each topic yields, for type checkers and editors. Written by ``make topics``."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Literal, Unpack, overload

from chefbotd.client.subscription import SubscribeOptions, Subscription

if TYPE_CHECKING:
    from chefbotd.client import models as t
    from chefbotd.client.sync_subscription import SyncSubscription
'''

CLASS = '''

class {name}(ABC):
    """``subscribe``, typed by the name of the topic."""
{overloads}
    @overload
    def subscribe(
        self, topics: str | Iterable[str], **options: Unpack[SubscribeOptions]
    ) -> {kind}[Any]: ...

    def subscribe(
        self, topics: str | Iterable[str], **options: Unpack[SubscribeOptions]
    ) -> {kind}[Any]:
        """Events of one or several topics, first the latest value of each; see ``{kind}``.

        Subscriptions of one client to the same topic share it, and have the same rate and policy.

        Raises:
            SubscriptionConflict: on starting, when the topic is subscribed with another rate or policy.
        """
        return self._subscription(topics, **options)

    @abstractmethod
    def _subscription(
        self, topics: str | Iterable[str], **options: Unpack[SubscribeOptions]
    ) -> {kind}[Any]: ...
'''

OVERLOAD = """
    @overload
    def subscribe(
        self, topics: Literal["{topic}"], **options: Unpack[SubscribeOptions]
    ) -> {kind}[t.{data}]: ..."""

FILE = Path(chefbotd.client.topics.__file__)


def written() -> str:
    """The module as it should be."""
    return HEAD + _class("Topics", "Subscription") + _class("SyncTopics", "SyncSubscription")


def _class(name: str, kind: str) -> str:
    overloads = "".join(
        OVERLOAD.format(topic=topic, kind=kind, data=model.__name__) for topic, model in DATA_BY_TOPIC.items()
    )
    return CLASS.format(name=name, kind=kind, overloads=overloads)


if __name__ == "__main__":
    FILE.write_text(written(), encoding="utf-8")
