"""Requests to the worker: progress, results, refusals, and what becomes of those that nobody answers."""

import asyncio
import contextlib

import pytest

from chefbotd.clock import run_virtual
from chefbotd.components.worker.messages import (
    Answer,
    Cancel,
    Failed,
    Measured,
    SkillRequest,
    ToWorker,
    event_in,
)
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.requests import WorkerLost
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import OdometryUpdated
from chefbotd.core.geometry import CERTAIN, ORIGIN, STANDING
from chefbotd.core.record import replace
from tests.chefbotd.components.worker.running import SCAN, Count, counting, running
from tests.fakes.worker import FakeChild, healthy


def test_a_request_is_answered_with_progress_on_the_way() -> None:
    """Who asks hears how far it is, and then the answer."""

    async def scene() -> None:
        async with running(counting) as (worker, _):
            told: list[tuple[float, float, str]] = []
            answer = await worker.request(
                "counting", Count(3), str, deadline_s=0.5, on_progress=lambda *progress: told.append(progress)
            )
            assert answer == "done", "though it took longer than the deadline: each progress begins it anew"
            assert told == [(float(done), 10.0, "counting") for done in range(10)]

    run_virtual(scene())


def test_a_request_can_be_given_up() -> None:
    """Cancelling tells the worker, and waits until it has given up."""

    async def scene() -> None:
        async with running(counting) as (worker, nursery):
            task = asyncio.create_task(
                worker.request("counting", Count(3), str, deadline_s=5.0, settles=True)
            )
            await asyncio.sleep(0.35)
            task.cancel()
            await asyncio.wait({task}, timeout=0.2)
            assert task.cancelled()
            assert nursery.last.received_of(Cancel)

    run_virtual(scene())


def test_a_request_that_was_done_before_it_could_be_given_up_is_told_as_done() -> None:
    """Nobody hears 'cancelled' of a map that was saved."""

    def stubborn(child: FakeChild) -> None:
        healthy(child)
        become_ready = child.answer

        def answer(message: ToWorker) -> None:
            become_ready(message)
            if isinstance(message, Cancel):
                child.say(Answer(message.id, b"\xa5saved"))

        child.answer = answer

    async def scene() -> None:
        async with running(stubborn) as (worker, _):
            task = asyncio.create_task(
                worker.request("counting", Count(3), str, deadline_s=5.0, settles=True)
            )
            await asyncio.sleep(0.1)
            task.cancel()
            await asyncio.wait({task}, timeout=0.2)
            assert task.result() == "saved"

    run_virtual(scene())


@pytest.mark.parametrize("settles", [False, True])
def test_a_service_that_is_cancelled_ends(settles: bool) -> None:
    """Its request to a worker that never answers, or dies meanwhile, swallows no cancellation: the daemon can end."""

    async def scene() -> None:
        async with running() as (worker, nursery):

            async def service() -> None:
                while True:
                    with contextlib.suppress(Refused):
                        await worker.request("counting", Count(3), str, deadline_s=60.0, settles=settles)
                    await asyncio.sleep(0.1)

            task = asyncio.create_task(service())
            await asyncio.sleep(0.35)
            task.cancel()
            await asyncio.sleep(0.1)
            nursery.last.die("it was killed by SIGKILL")
            await asyncio.wait({task}, timeout=1.0)
            assert task.cancelled()

    run_virtual(scene())


def test_a_refusal_comes_with_its_kind() -> None:
    """What the skill refuses is refused to the caller, in the same words, with their id and arguments."""
    said = {"id": "mapping.none", "arguments": {}}

    def refusing(child: FakeChild) -> None:
        healthy(child)
        become_ready = child.answer

        def answer(message: ToWorker) -> None:
            become_ready(message)
            if isinstance(message, SkillRequest):
                child.say(Failed(message.id, RefusalKind.NOT_MAPPING, "no map is being made", dict(said)))

        child.answer = answer

    async def scene() -> None:
        async with running(refusing) as (worker, _):
            with pytest.raises(Refused, match="no map is being made") as refused:
                await worker.request("counting", Count(3), str, deadline_s=5.0)
            assert refused.value.kind is RefusalKind.NOT_MAPPING
            assert refused.value.data == said

    run_virtual(scene())


def test_a_request_that_is_not_answered_in_time_ends_the_worker() -> None:
    """The caller hears that the worker is gone, and the reason names the deadline."""

    async def scene() -> None:
        async with running() as (worker, nursery):
            with pytest.raises(WorkerLost, match="ended before it was done"):
                await worker.request("counting", Count(3), str, deadline_s=2.0)
            assert nursery.children[0].killed
            await asyncio.sleep(0.1)
            assert worker.memory.status.reason == "it did not answer a request within 2 s"

    run_virtual(scene())


def test_who_waits_for_a_worker_that_dies_hears_so() -> None:
    """A request to a worker that is killed fails at once, and no later answer confuses the next one."""

    async def scene() -> None:
        async with running() as (worker, nursery):
            task = asyncio.create_task(worker.request("counting", Count(3), str, deadline_s=60.0))
            await asyncio.sleep(0.1)
            nursery.last.die("it was killed by SIGKILL")
            with pytest.raises(WorkerLost):
                await task
            with pytest.raises(WorkerLost, match="restarting: it was killed by SIGKILL"):
                await worker.request("counting", Count(3), str, deadline_s=60.0)

    run_virtual(scene())


def test_a_worker_that_does_not_read_holds_up_nothing() -> None:
    """Old scans give way and are counted, what was asked does not, and it all arrives in order once it reads."""

    async def scene() -> None:
        async with running(parameters=WorkerParameters(queue_kb=16)) as (worker, nursery):
            child = nursery.last
            child.stop_reading()
            for k in range(500):
                worker.send(replace(SCAN, stamp_s=float(k)))
                worker.send(OdometryUpdated(float(k), float(k), ORIGIN, STANDING, CERTAIN))
            asked = asyncio.create_task(worker.request("counting", Count(3), str, deadline_s=60.0))
            await asyncio.sleep(0.1)
            child.read_on()
            await asyncio.sleep(0.1)
            events = [event_in(message) for message in child.received_of(Measured)]
            scans = [event.stamp_s for event in events if isinstance(event, ScanMeasured)]
            assert 0 < len(scans) < 60
            assert scans == sorted(scans)
            assert scans[-1] == 499.0, "the newest is there"
            assert worker.dropped_measurements >= 1000 - 2 * 60
            assert len(child.received_of(SkillRequest)) == 1
            asked.cancel()
            child.say(Failed(1, None, "it was cancelled"))
            await asyncio.wait({asked})

    run_virtual(scene())
