"""The topics of a robot, their quality of service, and the header of what is published on them."""

import re
from collections import Counter
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from typing import Any, Final

from msgspec import Struct

from chefbot_vda5050 import versions

EVERY: Final = "+"
"""In place of a manufacturer or a serial number: the robots of all."""

LEVEL: Final = re.compile(r"[^/+#$\x00-\x1f]+")


class Kind(StrEnum):
    """The last level of a topic (6.5)."""

    ORDER = "order"
    INSTANT_ACTIONS = "instantActions"
    STATE = "state"
    VISUALIZATION = "visualization"
    CONNECTION = "connection"
    FACTSHEET = "factsheet"


QOS: Final = {kind: 1 if kind is Kind.CONNECTION else 0 for kind in Kind}
"""6.2."""

RETAINED: Final = frozenset({Kind.CONNECTION, Kind.FACTSHEET})
"""6.14 and 6.15."""


class RobotName(Struct, frozen=True):
    """A robot of a fleet; the two levels before it are agreed on by those who run the broker (6.3).

    Raises:
        ValueError: a level is empty, or has a letter that MQTT keeps for itself.
    """

    manufacturer: str
    serial_number: str
    interface: str = versions.V2.interface
    major_version: str = versions.V2.major

    def __post_init__(self) -> None:
        for level in (self.manufacturer, self.serial_number, self.major_version, *self.interface.split("/")):
            if level != EVERY and not LEVEL.fullmatch(level):
                raise ValueError(f"{level!a} cannot be a level of a topic: expected a name without / + # $")

    def topic(self, kind: Kind) -> str:
        """The full name of a topic."""
        return f"{self.interface}/{self.major_version}/{self.manufacturer}/{self.serial_number}/{kind}"


def parse_topic(topic: str) -> tuple[RobotName, Kind] | None:
    """Whose topic this is, and which; None: it is none of this interface, or no robot can have that name."""
    levels = topic.split("/")
    if len(levels) < 5 or levels[-1] not in set(Kind):
        return None
    try:
        name = RobotName(levels[-3], levels[-2], "/".join(levels[:-4]), levels[-4])
    except ValueError:
        return None
    return name, Kind(levels[-1])


def timestamp_of(seconds: float) -> str:
    """Seconds since 1970 as ISO 8601 in UTC with milliseconds."""
    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(milliseconds=round(seconds * 1000))
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def seconds_of(timestamp: str) -> float:
    """ISO 8601 as seconds since 1970; without a zone it is UTC.

    Raises:
        ValueError: it is no such time.
    """
    moment = datetime.fromisoformat(timestamp)
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


class Headers:
    """Counts the messages of each topic: ``header_id`` grows by one with each."""

    def __init__(self, name: RobotName, version: str) -> None:
        self._name, self.version = name, version
        self._sent: Counter[Kind] = Counter()

    def next(self, kind: Kind, now_s: float) -> dict[str, Any]:
        """The fields of the next header; ``now_s`` is seconds since 1970."""
        number = self._sent[kind]
        self._sent[kind] += 1
        return {
            "header_id": number,
            "timestamp": timestamp_of(now_s),
            "version": self.version,
            "manufacturer": self._name.manufacturer,
            "serial_number": self._name.serial_number,
        }
