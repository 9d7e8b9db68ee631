"""The parameters of the worker; needs no numpy."""

from pathlib import Path

from pydantic import Field

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
