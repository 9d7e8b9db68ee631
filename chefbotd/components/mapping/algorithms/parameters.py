"""The parameters of mapping, and the constants of SLAM.

The constants were derived from what lasers and wheels do, not fitted to one building.
"""

from typing import Any, ClassVar, Final

from msgspec.structs import asdict
from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record


class MatchingParameters(Record, frozen=True):
    """Matching a scan against what was seen shortly before.

    The odometry's errors are one sigma; the window reaches three of them. They are wide on purpose: scrubbing
    tyres and thresholds cost a tenth of a motion, and a window costs little.
    """

    laser_noise_m: float = 0.03
    """How far a lidar's point may be off, one sigma."""
    odometry_m: float = 0.02
    """What odometry's travel may be off by at least, one sigma."""
    odometry_m_per_m: float = 0.1
    """How much more for each metre that was driven."""
    odometry_m_per_rad: float = 0.03
    """How much more for each radian that was turned."""
    odometry_rad: float = 0.01
    """What odometry's heading may be off by at least, one sigma."""
    odometry_rad_per_rad: float = 0.1
    """How much more for each radian that was turned."""
    odometry_rad_per_m: float = 0.05
    """How much more for each metre that was driven."""
    max_window_m: float = 1.0
    """No scan is searched for farther than this from where odometry says."""
    max_window_rad: float = 0.6
    """No scan is searched for at a heading farther off than this."""
    max_jump_m: float = 5.0
    """No odometry is believed that says more between two scans."""
    fits_share: float = 0.6
    """Of the points that lie where the map knows something, so many must be on a surface."""
    suspicious_drop: float = 0.08
    """Where so much less fits than lately, a wider window is searched, in case the wheels slipped."""
    better_share: float = 0.1
    """What is found there must fit so much better."""
    min_overlap: float = 0.15
    """With less of the scan on known ground, the scan says nothing about where it is."""
    wheel_slip_window_m: float = 1.0
    """Where wheels may have slipped, a scan is searched for so far around."""
    wheel_slip_window_rad: float = 0.7
    """Where wheels may have slipped, it is searched for at headings so far off."""
    wheel_slip_share: float = 0.75
    """What is found there must fit by this share of its points."""
    lost_after_scans: int = 5
    """After so many scans in a row that fit nowhere the robot counts as lost."""


class SubmapParameters(Record, frozen=True):
    """Which scans are kept, and how many make a submap."""

    keyframe_m: float = 0.15
    """A scan is kept after so much travel."""
    keyframe_rad: float = 0.15
    """A scan is kept after so much of a turn."""
    length_m: float = 12.0
    """A submap ends after so much travel; a turned radian counts as half a metre."""
    drift_m_per_root_m: float = 0.02
    """How surely one submap is known from the other in travel: a random walk along the way."""
    drift_rad_per_root_m: float = 0.006
    """How surely one submap is known from the other in heading."""
    max_scans_per_place: int = 30
    """Scans kept per square metre and quarter turn; beyond it, what is driven again is not kept."""


class LoopParameters(Record, frozen=True):
    """When a place is recognised, and when that is believed."""

    every_m: float = 0.5
    """A place that was seen before is looked for after each so much travel."""
    submaps_at_once: int = 2
    """So many submaps are compared at a time, the likeliest first."""
    near_m: float = 2.0
    """A submap is compared if the robot may be so near to it."""
    not_within_m: float = 6.0
    """What was left less than this way ago is no loop."""
    max_window_m: float = 6.0
    """A place is searched for no farther than this from where it should be."""
    min_score: float = 0.4
    """A match must score so much to count."""
    min_score_when_lost: float = 0.5
    """So much where the robot is lost."""
    min_share: float = 0.75
    """Of the points so many must be on a surface that was seen before."""
    min_overlap: float = 0.5
    """So much of the scan must be on known ground."""
    rival_score: float = 0.9
    """Another place in the window that scores this share of the best makes the match ambiguous."""
    sure_within_m: float = 0.3
    """Where the drift is below this, one match is believed; beyond, several from different places must agree."""
    agree_m: float = 0.3
    """Two matches agree if they say the same within this distance,"""
    agree_rad: float = 0.06
    """Two matches agree if they say the same within this angle."""
    agreeing: int = 2
    """So many matches that agree close a loop."""
    agreeing_when_lost: int = 3
    """So many that agree tell a lost robot where it is."""
    remembered_m: float = 15.0
    """A match waits for others that agree for so long a way."""
    lookups_a_step: int = 30_000_000
    """How much of a search a step does, in likelihoods looked up; the rest follows with the next scans."""


class SlamParameters(Record, frozen=True):
    """Every step from scans to a map: constants for each."""

    matching: MatchingParameters = MatchingParameters()
    submaps: SubmapParameters = SubmapParameters()
    loops: LoopParameters = LoopParameters()


SLAM: Final = SlamParameters()

_EARLIER_NAMES = {
    "loops": {
        "window_at_most_m": "max_window_m",
        "least_score": "min_score",
        "least_share": "min_share",
        "least_overlap": "min_overlap",
    },
    "matching": {
        "window_at_most_m": "max_window_m",
        "window_at_most_rad": "max_window_rad",
        "jump_at_most_m": "max_jump_m",
        "least_overlap": "min_overlap",
        "slipped_window_m": "wheel_slip_window_m",
        "slipped_window_rad": "wheel_slip_window_rad",
        "slipped_share": "wheel_slip_share",
    },
    "submaps": {"most_scans_per_place": "max_scans_per_place"},
}


def _retired_tables() -> dict[str, dict[str, Any]]:
    """The tables of ``[mapping.slam]`` in the configurations of earlier versions, under every name that a key had."""
    tables = {name: asdict(getattr(SLAM, name)) for name in SLAM.__struct_fields__}
    return {
        name: table | {old: table[new] for old, new in _EARLIER_NAMES[name].items()}
        for name, table in tables.items()
    }


class MappingParameters(Parameters):
    """The ``[mapping]`` section: which lidars' scans make the map, and how often it is published and saved."""

    retired: ClassVar[dict[str, Any]] = {"slam": _retired_tables()}

    lidars: tuple[str, ...] | None = Field(default=None, min_length=1)
    """Their names, the leading one first; all that are configured, if none is named."""
    resolution_m: float = Field(default=0.05, gt=0, le=1)
    """The size of a map's cells."""
    publish_period_s: float = Field(default=1.0, gt=0, le=60)
    """How often changes of the map are published, at most."""
    autosave_period_s: float = Field(default=10.0, gt=0, le=3600)
    """How often a map that is being made is saved, at most; a large one less often."""
