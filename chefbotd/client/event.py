"""The events that a subscription yields."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, TypeVar

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
