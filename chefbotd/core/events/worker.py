"""The state of the worker process. Not imported by `__init__`, because only a robot with a lidar has a worker."""

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
