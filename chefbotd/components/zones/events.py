"""Zones: that those of a map were changed."""

from typing import ClassVar

from chefbotd.core.record import Level, LogLine, Record


class ZonesChanged(Record, frozen=True):
    """A client changed the zones of this map; ``revision`` is what they are now."""

    retained: ClassVar[bool] = True

    stamp_s: float
    map: str
    revision: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(Level.INFO, "zones", f"those of the map {self.map} were changed")
