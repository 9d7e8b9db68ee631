"""The events that a subscription yields."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from chefbotd.client.models import TopicData

D = TypeVar("D", bound="TopicData", covariant=True)


@dataclass(frozen=True, slots=True)
class Gap:
    """Telemetry that is missing because the connection was lost: for how long, why, and whether the daemon restarted.

    After a restart ``seq`` counts anew, and odometry begins at its origin.
    """

    reason: str
    lasted_s: float
    restarted: bool


@dataclass(frozen=True, slots=True)
class Event(Generic[D]):
    """One value of a topic: counted by ``seq``, stamped by the daemon's clock, ``age_s`` old when sent.

    ``gap`` is what is missing before it: on the first event of each topic after a reconnection, else None.
    """

    topic: str
    seq: int
    stamp_s: float
    age_s: float
    data: D
    gap: Gap | None = None
