"""Whether the robot knows where it is on the map in use. Loads no numpy."""

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record


class Alternative(Record, frozen=True):
    """A place where the robot may be, and how well the scan fits there (0 to 1)."""

    map_from_base: Pose2D
    fit: float


class LocalizationChanged(Record, frozen=True):
    """How localization stands: ``state`` is unknown, searching, localized, uncertain or lost; ``map`` is the one in use.

    While it searches, ``alternatives`` are all places where the robot may be, and ``searched`` is the share of the
    search that is done. ``jumps`` counts how often the published pose jumped: what was planned before is void then.
    """

    stamp_s: float
    state: str
    map: str | None
    fit: float
    alternatives: tuple[Alternative, ...]
    searched: float
    jumps: int
    reason: str
