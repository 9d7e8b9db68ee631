"""The topic ``worker``: the state of the process that maps, localizes and plans."""

from chefbotd.core.events.robot import WorkerData, WorkerReported
from chefbotd.rpc.topics import Topic, same_names

TOPICS = (Topic("worker", (WorkerReported,), WorkerData, same_names(WorkerData), always_known=True),)
