"""The topic ``worker``: the state of the process that maps, localizes and plans."""

from pydantic import Field

from chefbotd.core.events.worker import WorkerReported
from chefbotd.rpc.models import TopicData
from chefbotd.rpc.topics import Topic


class WorkerData(TopicData):
    """The worker process; ``reason`` says what it is doing, or why it is not ready."""

    state: str = Field(
        default="stopped", description="stopped, starting, warming, ready, restarting or unavailable"
    )
    pid: int | None = None
    restarts: int = 0
    rss_mb: float | None = Field(default=None, description="resident memory")
    cpu: float | None = Field(default=None, description="share of one core in the last second")
    reason: str = ""


TOPICS = (Topic("worker", (WorkerReported,), WorkerData, WorkerData.of, always_known=True),)
