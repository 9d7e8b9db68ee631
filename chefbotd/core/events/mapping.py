"""Maps: which one is in use, where the robot is on it, and the one that is being made. Loads no numpy."""

from typing import Annotated, ClassVar

from msgspec import Meta

from chefbotd.core.geometry import Pose2D, PoseCovariance
from chefbotd.core.grid_patch import GridPatch
from chefbotd.core.record import Level, LogLine, Record, state_line


class MapPoseUpdated(Record, frozen=True):
    """Where the robot was in the map at ``stamp_s``, how surely, and how well the scan fitted (0 to 1).

    ``map_from_odom`` holds until the next one: with it, odometry says where the robot is in the map now. ``state`` is
    mapping, wheel_slip (the odometry was wrong just now), uncertain (scans do not fit; odometry carries it), lost, or
    searching (lost, and looking for a known place): ``searched`` is the share of that search that is done.
    """

    stamp_s: float
    map_from_base: Pose2D
    map_from_odom: Pose2D
    covariance: PoseCovariance
    fit: float
    state: str
    searched: float = 0.0


class MapChanged(GridPatch, frozen=True):
    """Cells of the map that is being made, or all of them (``whole``): then what was known before is forgotten.

    They are percentages, -1 for unknown. Between two revisions one after the other nothing is missing.
    """

    whole: bool


class MappingData(Record, frozen=True):
    """The state of mapping; ``reason`` says what is wrong, if anything is."""

    state: Annotated[str, Meta(description="idle, mapping, paused or finishing")] = "idle"
    name: Annotated[str | None, Meta(description="the map that is being extended")] = None
    keyframes: int = 0
    loops: int = 0
    path_m: float = 0.0
    scans: int = 0
    unfinished: Annotated[bool, Meta(description="there is an unfinished map on the disk")] = False
    reason: str = ""
    warning: Annotated[str | None, Meta(description="what is lost of the unfinished map")] = None


class MappingChanged(MappingData, frozen=True, kw_only=True):
    """The state of mapping has changed. An empty ``warning`` is none."""

    retained: ClassVar[bool] = True

    stamp_s: float

    def log_line(self) -> LogLine:
        """What the log says of it."""
        return state_line("mapping", self.state, self.reason)


class MapSaved(Record, frozen=True):
    """The map was saved: what ``finish_mapping`` answers."""

    name: str
    version: int
    keyframes: int
    loops: int
    path_m: float


class MapLoaded(Record, frozen=True):
    """From now on this version of this map of the store in ``folder`` is the one in use.

    ``renamed_from`` is the name that the same map had until now; None: it is another map, or another version.
    """

    retained: ClassVar[bool] = True

    stamp_s: float
    folder: str
    name: str
    version: int
    renamed_from: str | None = None

    def log_line(self) -> LogLine:
        """What the log says of it."""
        return LogLine(Level.INFO, "maps", f"{self.name}, version {self.version}, is in use")


class MapUnloaded(Record, frozen=True):
    """The map that was in use has been deleted; none is in use."""

    stamp_s: float
    name: str


class Alternative(Record, frozen=True):
    """A place where the robot may be, and how well the scan fits there (0 to 1)."""

    map_from_base: Pose2D
    fit: float


class LocalizationChanged(Record, frozen=True):
    """How localization stands: ``state`` is unknown, searching, localized, uncertain or lost; ``map`` is the one in use.

    While it searches, ``alternatives`` are all places where the robot may be, and ``searched`` is the share of the
    search that is done. ``jumps`` counts how often the published pose jumped: what was planned before is void then.
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
        """What the log says of it."""
        return state_line("localization", self.state, self.reason)
