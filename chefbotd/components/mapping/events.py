"""Maps: which one is in use, where the robot is on it, and the one that is being made. Loads no numpy."""

from typing import Annotated, ClassVar

from msgspec import Meta

from chefbotd.core.geometry import Pose2D, PoseCovariance
from chefbotd.core.grid_patch import GridPatch
from chefbotd.core.record import Level, LogLine, Record, state_line


class MapPoseUpdated(Record, frozen=True):
    """The robot's pose in the map at ``stamp_s``, its covariance, and how well the scan fitted (0 to 1).

    ``map_from_odom`` holds until the next event: with it, odometry gives the present pose in the map. ``state`` is
    mapping, wheel_slip (the odometry was wrong just now), uncertain (scans do not fit, the pose follows odometry), lost,
    or searching (lost, and looking for a known place); ``searched`` is the finished share of that search. ``map`` is the
    map that the pose is in; None: a new one that is being made. With the state ended, there is no pose in that map any
    more: another one is in use, or none.
    """

    stamp_s: float
    map_from_base: Pose2D
    map_from_odom: Pose2D
    covariance: PoseCovariance
    fit: float
    state: str
    searched: float = 0.0
    map: str | None = None


POSE_ENDED = "ended"
"""The state of a pose that holds no longer."""


class MapChanged(GridPatch, frozen=True):
    """Changed cells of the map that is being made, or all of them (``whole``), which replace earlier ones.

    Cells are percentages, -1 for unknown. Revisions count up by one; a gap means that a change is missing.
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
        """The line in the log."""
        return state_line("mapping", self.state, self.reason)


class MapSaved(Record, frozen=True):
    """The map was saved. ``finish_mapping`` answers with this."""

    name: str
    version: int
    keyframes: int
    loops: int
    path_m: float


class MapLoaded(Record, frozen=True):
    """The map in use is now this version of this map, in the store in ``folder``.

    ``renamed_from`` is the name that the same map had until now; None: it is another map, or another version.
    """

    retained: ClassVar[bool] = True

    stamp_s: float
    folder: str
    name: str
    version: int
    renamed_from: str | None = None

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(Level.INFO, "maps", f"{self.name}, version {self.version}, is in use")


class MapUnloaded(Record, frozen=True):
    """The map that was in use has been deleted, or is not used any more for this ``reason``; none is in use."""

    stamp_s: float
    name: str
    reason: str = ""


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
