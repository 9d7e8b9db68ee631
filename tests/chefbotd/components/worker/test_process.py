"""The daemon's side of the worker, in front of a fake one on the virtual clock: the daemon lives on in every case."""

import asyncio
import contextlib

import pytest

from chefbotd.clock import run_virtual
from chefbotd.components.worker.messages import (
    Alive,
    Configure,
    Ready,
    SkillEvent,
    ToWorker,
    Unavailable,
    Warming,
    pack_body,
)
from chefbotd.components.worker.requests import WorkerLost
from chefbotd.components.worker.watch import WorkerState
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.worker.running import SCAN, Count, running
from tests.fakes.worker import FakeChild, Nursery, healthy, live


def test_it_is_configured_and_becomes_ready() -> None:
    """The first message says which skills to load; the states tell how far it is, and that it loads."""

    def slow(child: FakeChild) -> None:
        live(child)
        asyncio.get_running_loop().call_later(1.0, child.say, Warming("counting"))
        asyncio.get_running_loop().call_later(2.0, child.say, Ready())

    async def scene() -> None:
        async with running(slow) as (worker, nursery):
            assert nursery.last.received == [Configure({"counting": b"{}"})]
            await asyncio.sleep(1.2)
            assert worker.memory.status.reason == "loading counting"
            await asyncio.sleep(1.0)
            assert worker.is_ready
            states = list(dict.fromkeys(status.state for status in nursery.statuses))
            assert states == [WorkerState.STARTING, WorkerState.WARMING, WorkerState.READY]

    run_virtual(scene())


def test_a_dead_worker_is_started_again() -> None:
    """It is back after half a second, the restart is counted, and whoever has to tell it something is called again."""

    async def scene() -> None:
        async with running() as (worker, nursery):
            readied: list[int] = []
            worker.add_on_ready(lambda: readied.append(worker.memory.status.pid or 0))
            nursery.last.die("it was killed by SIGKILL")
            await asyncio.sleep(0.3)
            assert worker.memory.status.state is WorkerState.RESTARTING
            assert worker.memory.status.reason == "it was killed by SIGKILL"
            assert worker.memory.status.pid is None
            await asyncio.sleep(0.6)
            assert (worker.is_ready, worker.memory.status.restarts, readied) == (True, 1, [4001])

    run_virtual(scene())


def test_one_that_dies_again_and_again_is_given_time() -> None:
    """Half a second, 1, 2, 4 ... between the starts; after 30 s of health the count begins anew."""

    def stillborn(child: FakeChild) -> None:
        asyncio.get_running_loop().call_soon(child.die, "it ended with exit code 1")

    async def scene() -> None:
        async with running(stillborn) as (_, nursery):
            await asyncio.sleep(7.4 - 0.1)
            assert len(nursery.children) == 4, "at 0, 0.5, 1.5 and 3.5 s"
            nursery._raise = healthy
            await asyncio.sleep(31 + 1.0)
            nursery.last.die("again")
            await asyncio.sleep(0.6)
            assert len(nursery.children) == 6

    run_virtual(scene())


def test_a_worker_that_cannot_be_started_is_tried_again() -> None:
    """No process for lack of memory is no end of the daemon: it says why, and tries again."""

    async def scene() -> None:
        nursery = Nursery(healthy)
        nursery.refuses = True
        worker = nursery.worker()
        task = asyncio.create_task(worker.run())
        await asyncio.sleep(0.2)
        assert worker.memory.status.reason == "it cannot be started: no more processes"
        nursery.refuses = False
        await asyncio.sleep(0.5)
        assert worker.is_ready
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task

    run_virtual(scene())


def test_a_hung_worker_is_killed() -> None:
    """One that says nothing for 3 s is killed and replaced within 4."""

    async def scene() -> None:
        async with running() as (worker, nursery):
            first = nursery.last
            first.say = lambda message: None  # type: ignore[method-assign]
            await asyncio.sleep(2.9)
            assert not first.killed
            await asyncio.sleep(1.4)
            assert first.killed
            assert worker.is_ready
            assert worker.memory.status.restarts == 1

    run_virtual(scene())


def test_a_worker_that_is_busy_for_ever_is_killed() -> None:
    """Its other thread still says that it lives; but at one scan for over 20 s it is no use."""

    async def scene() -> None:
        async with running() as (worker, nursery):
            nursery.last.say(Alive("counting: a scan", 20.5))
            await asyncio.sleep(0.3)
            assert (
                worker.memory.status.reason
                == "it was busy with counting: a scan for 20.5 s, 20 s are allowed"
            )

    run_virtual(scene())


def test_a_worker_that_has_compiled_for_long_is_not_killed_when_it_is_ready() -> None:
    """What it was busy with before it was ready was loading, which has a bound of its own."""

    def slow(child: FakeChild) -> None:
        live(child)
        loop = asyncio.get_running_loop()
        loop.call_later(0.1, child.say, Warming("counting"))
        loop.call_later(40.05, child.say, Alive("loading counting", 39.9))
        loop.call_later(40.1, child.say, Ready())

    async def scene() -> None:
        async with running(slow) as (worker, _):
            await asyncio.sleep(40.6)
            assert worker.is_ready
            assert worker.memory.status.restarts == 0

    run_virtual(scene())


def test_a_worker_that_takes_too_much_memory_is_killed() -> None:
    """Within a quarter of a second of the reading, with the figure."""

    async def scene() -> None:
        async with running() as (worker, nursery):
            nursery.last.memory_mb = 900.0
            await asyncio.sleep(0.3)
            assert nursery.last.killed
            assert "900 MB" in worker.memory.status.reason

    run_virtual(scene())


@pytest.mark.parametrize(
    "data",
    [
        b"\xff" * 200,
        b"\x01\x00\x00\x00\xc1",
        b"\x00\x00\x00\x00",
        b"\x07\x00\x00\x00\x91\xa5ready",  # ready, though it is ready already
    ],
)
def test_garbage_ends_the_worker_and_nothing_else(data: bytes) -> None:
    """What is no message, or one at the wrong time, has the worker killed; the next one works."""

    async def scene() -> None:
        async with running() as (worker, nursery):
            first = nursery.last
            first.say_bytes(data)
            await asyncio.sleep(0.4)
            assert worker.memory.status.state is WorkerState.RESTARTING
            assert worker.memory.status.reason.startswith(
                ("it sent what is no message", "it says that it is ready")
            )
            await asyncio.sleep(0.6)
            assert worker.is_ready
            assert nursery.last is not first

    run_virtual(scene())


def test_a_flood_ends_it() -> None:
    """A worker that sends two thousand messages at once is killed; the loop has had its turns meanwhile."""

    async def scene() -> None:
        async with running() as (worker, nursery):
            first = nursery.last
            for _ in range(20):
                for _ in range(100):
                    first.say(Alive("", 0.0))
                await asyncio.sleep(0)
            await asyncio.sleep(0.3)
            assert first.killed
            assert worker.memory.status.reason.startswith("it sent 2")

    run_virtual(scene())


@pytest.mark.parametrize(
    ("told", "reason"),
    [
        (
            SkillEvent("other", pack_body(Pose2D()), "Pose2D"),
            "its skill 'other' tells what nobody knows: 'Pose2D'",
        ),
        (
            SkillEvent("counting", pack_body(Pose2D()), "Twist2D"),
            "'counting' tells what nobody knows: 'Twist2D'",
        ),
        (SkillEvent("counting", b"\x01", "Pose2D"), "counting sent what is no message"),
    ],
)
def test_what_a_skill_tells_reaches_its_listener(told: SkillEvent, reason: str) -> None:
    """A record goes to who listens to its class and skill; another skill's, or no such record, ends the worker."""

    async def scene() -> None:
        async with running() as (worker, nursery):
            heard: list[Pose2D] = []
            worker.add_listener("counting", Pose2D, heard.append)
            nursery.last.say(SkillEvent("counting", pack_body(Pose2D(1.0, 2.0, 0.5)), "Pose2D"))
            await asyncio.sleep(0.01)
            assert heard == [Pose2D(1.0, 2.0, 0.5)]
            nursery.last.say(told)
            await asyncio.sleep(0.3)
            assert reason in worker.memory.status.reason

    run_virtual(scene())


def test_a_missing_extra_is_said_once_and_for_all() -> None:
    """A worker that cannot work here is not started again, and requests are refused with its reason."""

    def without_numba(child: FakeChild) -> None:
        def answer(message: ToWorker) -> None:
            child.say(
                Unavailable("mapping needs numba, which is not installed: pip install 'chefbotd[navigation]'")
            )

        child.answer = answer

    async def scene() -> None:
        async with running(without_numba) as (worker, nursery):
            await asyncio.sleep(100)
            assert len(nursery.children) == 1
            assert worker.memory.status.state is WorkerState.UNAVAILABLE
            assert worker.memory.status.pid is None
            with pytest.raises(WorkerLost, match=r"unavailable: mapping needs numba.*chefbotd\[navigation\]"):
                await worker.request("counting", Count(3), str, deadline_s=1.0)

    run_virtual(scene())


def test_nothing_is_sent_to_a_worker_that_is_not_ready() -> None:
    """Scans are for a worker that has loaded its skills; before, they are let go."""

    async def scene() -> None:
        async with running(live) as (worker, nursery):
            worker.send(SCAN)
            await asyncio.sleep(0.1)
            assert nursery.last.received == [Configure({"counting": b"{}"})]

    run_virtual(scene())


def test_the_status_tells_memory_and_processor_once_a_second() -> None:
    """Used processor time becomes a share of one core."""

    async def scene() -> None:
        async with running() as (worker, nursery):
            before = len(nursery.statuses)
            nursery.last.memory_mb = 151.0
            for _ in range(30):
                nursery.last.used_s += 0.008
                await asyncio.sleep(0.1)
            assert worker.memory.status.rss_mb == 151.0
            assert worker.memory.status.cpu == pytest.approx(0.08, rel=0.05)
            assert 2 <= len(nursery.statuses) - before <= 4

    run_virtual(scene())


def test_it_ends_with_the_daemon() -> None:
    """The socket is closed, which lets the worker save and leave; nobody has to be killed."""

    async def scene() -> None:
        async with running() as (worker, nursery):
            pass
        assert not nursery.last.killed
        assert worker.memory.status.state is WorkerState.STOPPED

    run_virtual(scene())


def test_one_that_does_not_leave_is_killed() -> None:
    """The daemon's end waits for no worker longer than 1.5 s."""

    async def scene() -> None:
        async with running() as (_, nursery):
            nursery.last.stop_reading()
            begun_s = asyncio.get_running_loop().time()
        assert nursery.last.killed
        assert asyncio.get_running_loop().time() - begun_s == pytest.approx(1.5, abs=0.1)

    run_virtual(scene())
