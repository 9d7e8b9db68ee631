"""What comes of mapping and localization: poses in the map, and the map itself as it grows. Loads no numpy."""

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
