"""Where the robot may be on the map in use. Loads no numpy."""

from typing import ClassVar

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import LogLine, Record, state_line


class Alternative(Record, frozen=True):
    """A possible place of the robot, and how well the scan fits there (0 to 1)."""

    map_from_base: Pose2D
    fit: float


class LocalizationChanged(Record, frozen=True):
    """The state of localization: unknown, searching, localized, uncertain or lost; ``map`` is the map in use.

    While it searches, ``alternatives`` are all possible places, and ``searched`` is the finished share of the search.
    ``jumps`` counts the jumps of the published pose; plans made before a jump are void.
    """

    retained: ClassVar[bool] = True

    stamp_s: float
    state: str
    map: str | None
    fit: float
    alternatives: tuple[Alternative, ...]
    searched: float
    jumps: int
    reason: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return state_line("localization", self.state, self.reason)
