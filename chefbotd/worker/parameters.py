"""The limits of the worker process."""

from pathlib import Path

from pydantic import Field

from chefbotd.core.parameters import Parameters


class WorkerParameters(Parameters):
    """The ``[worker]`` section.

    A worker that breaks a bound is killed and started again. The bounds are far beyond what healthy ones need.
    """

    enabled: bool = True
    niceness: int = Field(default=10, ge=0, le=19)
    """How far the worker stands back for the daemon and others (nice(2))."""
    start_timeout_s: float = Field(default=180.0, gt=0, le=3600)
    """Until it is ready. Compiling for the first time takes half a minute here, and minutes on a small board."""
    silence_timeout_s: float = Field(default=3.0, gt=0, le=60)
    """It says twice a second that it lives."""
    step_timeout_s: float = Field(default=20.0, gt=0, le=600)
    """For what it does without having been asked, such as a scan."""
    max_memory_mb: float = Field(default=800.0, ge=100, le=65536)
    """Resident memory. SLAM in a flat takes 120 MB; compiling, once, 300 MB."""
    restart_delay_s: float = Field(default=0.5, gt=0, le=60)
    """Doubled with each failure in a row, up to:"""
    max_restart_delay_s: float = Field(default=30.0, gt=0, le=600)
    queue_kb: int = Field(default=64, ge=8, le=16384)
    """So much of scans (4 kB each) and odometry waits for it to read; then the oldest give way."""
    cache_folder: Path | None = None
    """For compiled code. Without it: systemd's CacheDirectory=, else numba's own choice."""
