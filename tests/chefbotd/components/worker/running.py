"""A worker that is played by the test, on a virtual clock."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable

import numpy as np

from chefbotd.components.worker.messages import (
    Answer,
    Cancel,
    Failed,
    Message,
    RequestProgress,
    SkillRequest,
    ToWorker,
)
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.process import Worker
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import Pose2D
from chefbotd.core.scan import LaserScan
from tests.fakes.worker import FakeChild, Nursery, healthy

SCAN = ScanMeasured(1.0, "top", Pose2D(0.1, 0.0, 0.3), LaserScan(1.0, *np.zeros((3, 300))))


class Count(Message, frozen=True, tag="count"):
    """A request of the test's own skill."""

    to: int


@contextlib.asynccontextmanager
async def running(
    raise_child: Callable[[FakeChild], None] = healthy, parameters: WorkerParameters | None = None
) -> AsyncIterator[tuple[Worker, Nursery]]:
    """A worker that has had a moment to start."""
    nursery = Nursery(raise_child)
    worker = nursery.worker(parameters)
    task = asyncio.create_task(worker.run())
    try:
        await asyncio.sleep(0.1)
        yield worker, nursery
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


def counting(child: FakeChild) -> None:
    """Answers a request with 10 steps of progress, a tenth of a second each, unless it is cancelled."""
    healthy(child)
    become_ready, loop = child.answer, asyncio.get_running_loop()
    cancelled: set[int] = set()

    def advance(number: int, done: int) -> None:
        if number in cancelled:
            child.say(Failed(number, None, "it was cancelled"))
        elif done == 10:
            child.say(Answer(number, b"\xa4done"))
        else:
            child.say(RequestProgress(number, done, 10, "counting"))
            loop.call_later(0.1, advance, number, done + 1)

    def answer(message: ToWorker) -> None:
        become_ready(message)
        if isinstance(message, SkillRequest):
            advance(message.id, 0)
        elif isinstance(message, Cancel):
            cancelled.add(message.id)

    child.answer = answer
