"""A topic: its events, the model of its data, and the conversion between them.

A topic's state is its latest event, except where the topic says how an event joins what came before (``ranges``
holds the latest beam of every sensor); an event that leaves the same object is not sent. States are cheap. Data is made
from them only for someone who asked.
"""

from collections.abc import Callable
from typing import Any, TypeVar

from msgspec import Struct, convert

from chefbotd.core.record import Record
from chefbotd.rpc.encoding import Sent

R = TypeVar("R", bound=Record)


def same_names(model: type[R]) -> Callable[[object | None], R]:
    """Makes the record of what a value has under the same names; without a value its defaults."""
    return lambda value: model() if value is None else convert(value, model, from_attributes=True)


class Topic(Struct, frozen=True):
    """Events of an ``on_demand`` topic are not even made unless someone subscribes: ``demanded`` is called when it does.

    It is called with False when the last subscriber has left.
    Of a ``passing`` one every event is sent, in order, and nobody gets an old one, also not with ``get_state``.
    One that is ``always_known`` has data before its first event, ``data(None)``, and a key of its own in ``get_state``.
    Guests may subscribe to those ``for_guests`` alone.
    """

    name: str
    events: tuple[type[Any], ...]
    model: type[Sent]
    data: Callable[[Any], Sent]
    join: Callable[[Any, Any], Any] | None = None
    on_demand: bool = False
    passing: bool = False
    always_known: bool = False
    demanded: Callable[[bool], None] | None = None
    for_guests: bool = False
