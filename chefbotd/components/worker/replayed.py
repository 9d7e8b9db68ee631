"""What a replay takes from a recording in place of the worker's process."""

from chefbotd.components.worker.messages import FROM_WORKER, SkillEvent
from chefbotd.components.worker.process import Worker, WorkerStatus
from chefbotd.components.worker.watch import LIVING, WorkerState
from chefbotd.core.events.inputs import WorkerGone, WorkerSaid
from chefbotd.core.events.robot import WorkerReported
from chefbotd.features.feature import ReplayedInputs


class ReplayedWorker:
    """The channel to a worker that is not there."""

    dropped = 0

    def send(self, message: object) -> None:
        """It goes nowhere."""

    def close(self) -> None:
        """Nothing is open."""


def replayed_inputs(worker: Worker) -> ReplayedInputs:
    """What the recorded worker said, how it stood, and when it was gone."""

    def follow(status: WorkerStatus) -> None:
        worker.follow(status, ReplayedWorker() if status.state in LIVING else None)  # type: ignore[arg-type]

    def report(event: WorkerReported) -> None:
        state = WorkerState(event.state)
        follow(WorkerStatus(state, event.pid, event.restarts, event.rss_mb, event.cpu, event.reason))

    def say(entry: WorkerSaid) -> None:
        message = FROM_WORKER.decode(entry.message)
        if isinstance(message, SkillEvent) and not message.kind:
            raise ValueError(
                "what the worker said was recorded by a version whose messages this one does not read; "
                "the version that recorded it replays it ('chefbotctl log info' tells which)"
            )
        worker.take_of_skill(message)

    return ReplayedInputs(
        {WorkerReported: report, WorkerSaid: say, WorkerGone: lambda entry: worker.forget_pending()},
        lambda: follow(worker.memory.status),
    )
