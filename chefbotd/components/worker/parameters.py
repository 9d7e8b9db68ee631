"""The parameters of the worker, and the sections for the skills that it runs; needs no numpy."""

from pathlib import Path

from pydantic import Field

from chefbotd.components.navigation.algorithms.states import UnknownSpace
from chefbotd.core.parameters import Parameters


class WorkerParameters(Parameters):
    """The ``[worker]`` section.

    A worker that breaks a bound is killed and started again. The bounds are far beyond what healthy ones need.
    """

    enabled: bool = True
    """The process that makes maps and localizes is started; without it the robot drives, but knows no map."""
    niceness: int = Field(default=10, ge=0, le=19)
    """How far the worker stands back for the daemon and others (nice(2))."""
    start_timeout_s: float = Field(default=180.0, gt=0, le=3600)
    """The processor time that the worker may use until it is ready. Compiling for the first time takes half a
    minute, and minutes on a small board."""
    silence_timeout_s: float = Field(default=3.0, gt=0, le=60)
    """A worker that has not said for so long that it lives is killed. It says so twice a second."""
    step_timeout_s: float = Field(default=20.0, gt=0, le=600)
    """The longest that it may take for what nobody asked for, such as a scan."""
    max_memory_mb: float = Field(default=800.0, ge=100, le=65536)
    """A worker that takes more resident memory is killed. Mapping a flat takes 120 MB, compiling 300 MB once."""
    restart_delay_s: float = Field(default=0.5, gt=0, le=60)
    """The wait before a worker that has ended is started again; it doubles with each failure in a row."""
    max_restart_delay_s: float = Field(default=30.0, gt=0, le=600)
    """The longest wait before the worker is started again."""
    queue_kb: int = Field(default=64, ge=8, le=16384)
    """So much of scans (4 kB each) and odometry waits for it to read; then the oldest give way."""
    cache_folder: Path | None = None
    """For compiled code. Without it: systemd's CacheDirectory=, else numba's own choice."""


class LocalizationSection(Parameters):
    """Which lidars' scans tell where the robot is, and what it may do by itself."""

    lidars: tuple[str, ...] | None = Field(default=None, min_length=1)
    """Their names, the leading one first; all that are configured, if none is named."""
    auto_search: bool = True
    """Whether a robot that is lost looks everywhere without being asked to."""
    turn_at_start: bool = False
    """Whether a robot that has not found itself yet, and cannot by looking for 3 s, may turn once on the spot."""
    save_period_s: float = Field(default=5.0, gt=0, le=3600)
    """How often the pose is kept on disk, at most; a robot that stands is not kept again."""


class NavigationSection(Parameters):
    """How fast the robot drives by itself, and what it does after a person has driven meanwhile."""

    max_speed_m_s: float = Field(default=0.30, gt=0, le=10)
    """No faster than this; 0.30 m/s is the fastest that navigation was tried with."""
    unknown_space: UnknownSpace = UnknownSpace.BLOCKED
    """Whether paths lead through what the map knows nothing of: blocked, avoided (at six times the cost) or free."""
    comfort_m: float = Field(default=0.30, gt=0, le=5)
    """Paths keep so far from what stands where there is room; more room than that beside the robot is worth nothing."""
    home_place: str = Field(default="home", min_length=1, max_length=64)
    """The place of the map in use to which ``go_home`` drives."""
    dock_place: str = Field(default="dock", min_length=1, max_length=64)
    """The place to which ``dock`` drives: where the robot is charged, with the heading that it needs there."""
    resume_after_takeover: bool = True
    """Whether a goal goes on when whoever took over has let go; otherwise it waits for ``resume_navigation``."""
