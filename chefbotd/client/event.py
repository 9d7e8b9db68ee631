"""The events that a subscription yields, and the latest one of each topic in a state."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, TypeVar

from chefbotd.client.errors import NotReported
from chefbotd.core.record import Record

if TYPE_CHECKING:
    from chefbotd.rpc.encoding import Sent

D = TypeVar("D", bound="Sent", covariant=True)


class Gap(Record, frozen=True):
    """Telemetry that is missing because the connection was lost: for how long, why, and whether the daemon restarted.

    After a restart ``seq`` counts anew, and odometry begins at its origin.
    """

    reason: str
    lasted_s: float
    restarted: bool


class Event(Record, Generic[D], frozen=True):
    """One value of a topic: counted by ``seq``, stamped by the daemon's clock, ``age_s`` old when sent.

    ``gap`` is what is missing before it: on the first event of each topic after a reconnection, else None.
    """

    topic: str
    seq: int
    stamp_s: float
    age_s: float
    data: D
    gap: Gap | None = None


class Latest(Generic[D]):
    """The latest data of one topic of a state. Raises ``NotReported`` where there is none yet."""

    def __init__(self, topic: str, model: type[D]) -> None:
        self._topic, self._model = topic, model

    def __get__(self, state: Any, owner: type[Any]) -> D:
        event = state.topics.get(self._topic)
        if event is None or not isinstance(event.data, self._model):
            link = "" if state.link.state == "up" else f"; the link is down: {state.link.reason}"
            raise NotReported(f"the robot has not reported {self._topic} yet{link}")
        return event.data
