"""How the worker process stands. Not imported by the package's `__init__`: only a robot with a lidar has a worker."""

from chefbotd.core.record import Record


class WorkerReported(Record, frozen=True):
    """Its state, memory and processor share, told with each change and once a second; ``reason`` says what is wrong.

    ``state`` is stopped, starting, warming, ready, restarting or unavailable.
    """

    stamp_s: float
    state: str
    pid: int | None
    restarts: int
    rss_mb: float | None
    cpu: float | None
    reason: str
