"""The parameters of SLAM. They were derived from what lasers and wheels do, not fitted to one building."""

from pydantic import Field

from chefbotd.core.parameters import Parameters, section


class MatchingParameters(Parameters):
    """Matching a scan against what was seen shortly before.

    The odometry's errors are one sigma; the window reaches three of them. They are wide on purpose: scrubbing
    tyres and thresholds cost a tenth of a motion, and a window costs little.
    """

    laser_noise_m: float = Field(default=0.03, gt=0, le=0.5)
    """How far a lidar's point may be off, one sigma."""
    odometry_m: float = Field(default=0.02, gt=0, le=1)
    """What odometry's travel may be off by at least, one sigma."""
    odometry_m_per_m: float = Field(default=0.1, ge=0, le=1)
    """How much more for each metre that was driven."""
    odometry_m_per_rad: float = Field(default=0.03, ge=0, le=1)
    """How much more for each radian that was turned."""
    odometry_rad: float = Field(default=0.01, gt=0, le=1)
    """What odometry's heading may be off by at least, one sigma."""
    odometry_rad_per_rad: float = Field(default=0.1, ge=0, le=1)
    """How much more for each radian that was turned."""
    odometry_rad_per_m: float = Field(default=0.05, ge=0, le=1)
    """How much more for each metre that was driven."""
    max_window_m: float = Field(default=1.0, gt=0, le=5)
    """No scan is searched for farther than this from where odometry says."""
    max_window_rad: float = Field(default=0.6, gt=0, le=3.2)
    """No scan is searched for at a heading farther off than this."""
    max_jump_m: float = Field(default=5.0, gt=0, le=100)
    """No odometry is believed that says more between two scans."""
    fits_share: float = Field(default=0.6, gt=0, le=1)
    """Of the points that lie where the map knows something, so many must be on a surface."""
    suspicious_drop: float = Field(default=0.08, gt=0, le=1)
    """Where so much less fits than lately, a wider window is searched, in case the wheels slipped."""
    better_share: float = Field(default=0.1, ge=0, le=1)
    """What is found there must fit so much better."""
    min_overlap: float = Field(default=0.15, ge=0, le=1)
    """With less of the scan on known ground, the scan says nothing about where it is."""
    wheel_slip_window_m: float = Field(default=1.0, gt=0, le=5)
    """Where wheels may have slipped, a scan is searched for so far around."""
    wheel_slip_window_rad: float = Field(default=0.7, gt=0, le=3.2)
    """Where wheels may have slipped, it is searched for at headings so far off."""
    wheel_slip_share: float = Field(default=0.75, gt=0, le=1)
    """What is found there must fit by this share of its points."""
    lost_after_scans: int = Field(default=5, ge=1, le=100)
    """After so many scans in a row that fit nowhere the robot counts as lost."""


class SubmapParameters(Parameters):
    """Which scans are kept, and how many make a submap."""

    keyframe_m: float = Field(default=0.15, gt=0, le=2)
    """A scan is kept after so much travel."""
    keyframe_rad: float = Field(default=0.15, gt=0, le=2)
    """A scan is kept after so much of a turn."""
    length_m: float = Field(default=12.0, gt=0, le=100)
    """A submap ends after so much travel; a turned radian counts as half a metre."""
    drift_m_per_root_m: float = Field(default=0.02, gt=0, le=1)
    """How surely one submap is known from the other in travel: a random walk along the way."""
    drift_rad_per_root_m: float = Field(default=0.006, gt=0, le=1)
    """How surely one submap is known from the other in heading."""
    max_scans_per_place: int = Field(default=30, ge=4, le=1000)
    """Scans kept per square metre and quarter turn; beyond it, what is driven again is not kept."""


class LoopParameters(Parameters):
    """When a place is recognised, and when that is believed."""

    every_m: float = Field(default=0.5, gt=0, le=10)
    """A place that was seen before is looked for after each so much travel."""
    submaps_at_once: int = Field(default=2, ge=1, le=20)
    """So many submaps are compared at a time, the likeliest first."""
    near_m: float = Field(default=2.0, gt=0, le=20)
    """A submap is compared if the robot may be so near to it."""
    not_within_m: float = Field(default=6.0, gt=0, le=100)
    """What was left less than this way ago is no loop."""
    max_window_m: float = Field(default=6.0, gt=0, le=20)
    """A place is searched for no farther than this from where it should be."""
    min_score: float = Field(default=0.4, gt=0, le=1)
    """A match must score so much to count."""
    min_score_when_lost: float = Field(default=0.5, gt=0, le=1)
    """So much where the robot is lost."""
    min_share: float = Field(default=0.75, gt=0, le=1)
    """Of the points so many must be on a surface that was seen before."""
    min_overlap: float = Field(default=0.5, gt=0, le=1)
    """So much of the scan must be on known ground."""
    rival_score: float = Field(default=0.9, gt=0, le=1)
    """Another place in the window that scores this share of the best makes the match ambiguous."""
    sure_within_m: float = Field(default=0.3, gt=0, le=5)
    """Where the drift is below this, one match is believed; beyond, several from different places must agree."""
    agree_m: float = Field(default=0.3, gt=0, le=5)
    """Two matches agree if they say the same within this distance,"""
    agree_rad: float = Field(default=0.06, gt=0, le=1)
    """Two matches agree if they say the same within this angle."""
    agreeing: int = Field(default=2, ge=1, le=20)
    """So many matches that agree close a loop."""
    agreeing_when_lost: int = Field(default=3, ge=1, le=20)
    """So many that agree tell a lost robot where it is."""
    remembered_m: float = Field(default=15.0, gt=0, le=200)
    """A match waits for others that agree for so long a way."""
    lookups_a_step: int = Field(default=30_000_000, ge=100_000)
    """How much of a search a step does, in likelihoods looked up; the rest follows with the next scans."""


class SlamParameters(Parameters):
    """Every step from scans to a map: a table for each."""

    matching: MatchingParameters = section()
    submaps: SubmapParameters = section()
    loops: LoopParameters = section()


class MappingParameters(Parameters):
    """The ``[mapping]`` section: which lidars' scans make the map, and how often it is published and saved."""

    lidars: tuple[str, ...] | None = Field(default=None, min_length=1)
    """Their names, the leading one first; all that are configured, if none is named."""
    resolution_m: float = Field(default=0.05, gt=0, le=1)
    """The size of a map's cells."""
    publish_period_s: float = Field(default=1.0, gt=0, le=60)
    """How often changes of the map are published, at most."""
    autosave_period_s: float = Field(default=10.0, gt=0, le=3600)
    """How often a map that is being made is saved, at most; a large one less often."""
    slam: SlamParameters = section()
