"""Whether a message has arrived in time: a robot never drives an order that was under way for long.

QoS 0 and a session that ends with the connection keep the broker from storing orders. What remains is a network that
holds bytes back, and a master that publishes retained: the message's age and its ``headerId`` tell.
"""

from msgspec import Struct

from chefbot_vda5050.messages import Header
from chefbot_vda5050.topics import seconds_of


class Freshness(Struct, frozen=True):
    """The latest header of a topic; ``stamp_s`` is when it was written, by its sender."""

    header_id: int = -1
    stamp_s: float = 0.0


def judge_age(
    latest: Freshness, header: Header, now_s: float, max_age_s: float, *, retained: bool = False
) -> tuple[Freshness, str]:
    """The latest header now, and why the message is too late; empty: it is in time. ``max_age_s`` 0: any age will do.

    ``now_s`` and the stamps are seconds since 1970, by clocks that agree to much less than ``max_age_s``.
    """
    if retained:
        return latest, "the broker had kept it (retained), so its age is not known"
    if why := age_problem(header, now_s, max_age_s):
        return latest, why
    stamp_s = seconds_of(header.timestamp)
    if header.header_id <= latest.header_id and stamp_s < latest.stamp_s:
        return latest, f"headerId {header.header_id} came after {latest.header_id}"
    return Freshness(header.header_id, stamp_s), ""


def age_problem(header: Header, now_s: float, max_age_s: float) -> str:
    """Why a message is too old by now, or from the future; empty: it is not."""
    try:
        age_s = now_s - seconds_of(header.timestamp)
    except ValueError:
        return f"its timestamp {header.timestamp!a} is no time"
    if not max_age_s or abs(age_s) <= max_age_s:
        return ""
    when = "old" if age_s > 0 else "ahead of the robot's clock"
    return f"it is {abs(age_s):.1f} s {when}, more than {max_age_s:g} s"
