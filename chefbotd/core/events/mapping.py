"""Maps: which one is in use, where the robot is on it, and the one that is being made. Loads no numpy."""

from chefbotd.core.geometry import Pose2D, PoseCovariance
from chefbotd.core.record import Record


class MapPoseUpdated(Record, frozen=True):
    """Where the robot was in the map at ``stamp_s``, how surely, and how well the scan fitted (0 to 1).

    ``map_from_odom`` holds until the next one: with it, odometry says where the robot is in the map now. ``state`` is
    mapping, wheel_slip (the odometry was wrong just now), uncertain (scans do not fit; odometry carries it) or lost.
    """

    stamp_s: float
    map_from_base: Pose2D
    map_from_odom: Pose2D
    covariance: PoseCovariance
    fit: float
    state: str


class MapChanged(Record, frozen=True):
    """Cells of the map that is being made, or all of them (``whole``): then what was known before is forgotten.

    They are those from (``row``, ``column``) on, ``part_rows`` by ``part_columns``: a signed byte each, in percent, -1
    for unknown, row by row from the lowest y up, compressed by zlib. ``map_from_grid`` is where the outer corner of the
    grid's first cell lies. Between two revisions one after the other nothing is missing.
    """

    stamp_s: float
    revision: int
    resolution_m: float
    map_from_grid: Pose2D
    columns: int
    rows: int
    column: int
    row: int
    part_columns: int
    part_rows: int
    whole: bool
    cells: bytes


class MappingChanged(Record, frozen=True):
    """How the map stands that is being made: ``state`` is idle, mapping, paused or finishing.

    ``name`` is the map that is being extended. ``unfinished``: one that was never finished lies on the disk; ``warning``
    says what is lost of it, if anything is.
    """

    stamp_s: float
    state: str
    name: str | None
    keyframes: int
    loops: int
    path_m: float
    scans: int
    unfinished: bool
    reason: str
    warning: str = ""


class MapLoaded(Record, frozen=True):
    """From now on this version of this map of the store in ``folder`` is the one in use."""

    stamp_s: float
    folder: str
    name: str
    version: int


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

    stamp_s: float
    state: str
    map: str | None
    fit: float
    alternatives: tuple[Alternative, ...]
    searched: float
    jumps: int
    reason: str
