"""Zones: that those of a map were changed."""

from typing import ClassVar

from chefbotd.core.record import Level, LogLine, Record
from chefbotd.core.sentence import Sentence


class ZonesChanged(Record, frozen=True):
    """A client changed the zones of this map; ``revision`` is what they are now."""

    retained: ClassVar[bool] = True

    stamp_s: float
    map: str
    revision: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(
            Level.INFO,
            "zones",
            Sentence("zones.changed", "those of the map {map} were changed", map=self.map),
        )
