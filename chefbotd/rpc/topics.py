"""A topic: its events, the model of its data, and the conversion between them.

A topic's state is its latest event, except where the topic says how an event joins what came before (``ranges``
holds the latest beam of every sensor). States are cheap. Data is made from them only for someone who asked.
"""

from collections.abc import Callable
from typing import Any

from msgspec import Struct

from chefbotd.rpc.models import TopicData


class Topic(Struct, frozen=True):
    """Events of an ``on_demand`` topic are not even made unless someone subscribes: ``demanded`` is called when it does.

    It is called with False when the last subscriber has left.
    One that is ``always_known`` has data before its first event, ``data(None)``, and a key of its own in ``get_state``.
    """

    name: str
    events: tuple[type[Any], ...]
    model: type[TopicData]
    data: Callable[[Any], TopicData]
    join: Callable[[Any, Any], Any] | None = None
    on_demand: bool = False
    always_known: bool = False
    demanded: Callable[[bool], None] | None = None
