"""Edits of maps: that those of a map were changed."""

from typing import ClassVar

from chefbotd.core.record import Level, LogLine, Record
from chefbotd.core.sentence import Sentence


class MapEdited(Record, frozen=True):
    """A client changed the edits of this map; ``revision`` is what they are now."""

    retained: ClassVar[bool] = True

    stamp_s: float
    map: str
    revision: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(
            Level.INFO, "map_edits", Sentence("map_edits.edited", "the map {map} was edited", map=self.map)
        )
