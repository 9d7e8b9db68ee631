"""What happens to the worker process: killed, hung, too large, talking nonsense, not reading. No wheel notices."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager

from chefbotd.components.worker.messages import Alive, frame_message
from chefbotd.core.events import OdometryUpdated
from chefbotd.core.geometry import CERTAIN, STANDING, Pose2D
from tests.fakes.worker import FakeChild, Nursery, healthy
from tests.scenarios.fault_run import Fault, FaultRun
from tests.scenarios.faults.outcomes import drives_on

NURSERY = Nursery(healthy)
"""Where the workers of these runs come from; the last one is that of the present run."""

WITH_LIDAR: Mapping[str, object] = {
    "lidar": [{"name": "top", "model": "ld19", "device": "/dev/top", "guards": False}],
    "maps.folder": "/dev/null/maps",
}
BACK_S = 2.0


async def is_back(fault_run: FaultRun, broken: FakeChild, why: str) -> None:
    """Another one is ready, and the topic has said what was wrong with this one."""
    await asyncio.sleep(BACK_S)
    worker = await fault_run.topic("worker")
    fault_run.check(worker["state"] == "ready", f"the worker is {worker['state']}")
    fault_run.check(worker["restarts"] >= 1, "it was not started again")
    fault_run.check(NURSERY.last is not broken, "the same one goes on")
    reasons = [status.reason for status in NURSERY.statuses]
    told = await fault_run.robot.client.get_stats()
    fault_run.check(told.worker_restarts >= 1, f"no restart is counted ({why}, {reasons})")


@asynccontextmanager
async def killed(fault_run: FaultRun) -> AsyncIterator[None]:
    """As by kill -9, or by the kernel when memory is out."""
    broken = NURSERY.last
    broken.die("it was killed by SIGKILL")
    yield
    await is_back(fault_run, broken, "killed")


@asynccontextmanager
async def killed_again_and_again(fault_run: FaultRun) -> AsyncIterator[None]:
    """Each of them dies as soon as it is ready."""
    for _ in range(3):
        NURSERY.last.die("it ended with exit code 1: MemoryError")
        await asyncio.sleep(0.1)
    yield


@asynccontextmanager
async def hung(fault_run: FaultRun) -> AsyncIterator[None]:
    """As by SIGSTOP: it neither reads nor says anything more."""
    broken = NURSERY.last
    broken.stop_reading()
    broken.say = lambda message: None  # type: ignore[method-assign]
    yield
    await is_back(fault_run, broken, "hung")


@asynccontextmanager
async def busy_for_ever(fault_run: FaultRun) -> AsyncIterator[None]:
    """Its other thread says that it lives, but its work does not end."""
    broken = NURSERY.last
    broken.say(Alive("mapping: a scan", 500.0))
    yield
    await is_back(fault_run, broken, "busy")


@asynccontextmanager
async def too_large(fault_run: FaultRun) -> AsyncIterator[None]:
    """It takes more memory than it may."""
    broken = NURSERY.last
    broken.memory_mb = 2000.0
    yield
    await is_back(fault_run, broken, "large")


@asynccontextmanager
async def nonsense(data: bytes, fault_run: FaultRun) -> AsyncIterator[None]:
    """It sends what is no message, or what cannot be."""
    broken = NURSERY.last
    broken.say_bytes(data)
    yield
    await is_back(fault_run, broken, "nonsense")


@asynccontextmanager
async def flood(fault_run: FaultRun) -> AsyncIterator[None]:
    """It sends three thousand messages as fast as they are read."""
    broken, message = NURSERY.last, frame_message(Alive("", 0.0))
    for _ in range(30):
        if broken.killed:
            break
        broken.say_bytes(message * 100)
        await asyncio.sleep(0.001)
    yield
    await is_back(fault_run, broken, "flood")


@asynccontextmanager
async def does_not_read(fault_run: FaultRun) -> AsyncIterator[None]:
    """It lives, and leaves unread what it is sent: old measurements give way, memory is bounded."""
    slow = NURSERY.last
    slow.stop_reading()
    for k in range(5000):
        now_s = asyncio.get_running_loop().time()
        event = OdometryUpdated(now_s, now_s, Pose2D(0.001 * k), STANDING, CERTAIN)
        fault_run.robot.daemon.bus.publish(event)
    yield
    stats = (await fault_run.robot.client.get_stats()).members
    fault_run.check(stats["worker_dropped"] > 1000, f"dropped {stats['worker_dropped']}")
    slow.read_on()


KILLED = "The worker is killed"
HUNG = "The worker hangs"
NONSENSE = "The worker sends garbage"
ENDED = drives_on("the worker has ended")


def _fault(row: str, name: str, inject: object, **more: object) -> Fault:
    return Fault(
        row,
        name,
        inject,
        **{"expected": ENDED, "overrides": WITH_LIDAR, "spawn_worker": NURSERY.spawn} | more,  # type: ignore[arg-type]
    )


FAULTS = (
    _fault(KILLED, "worker killed", killed),
    _fault(KILLED, "worker killed again and again", killed_again_and_again),
    _fault(HUNG, "worker hung", hung, lasts_s=5.0),
    _fault(HUNG, "worker busy for ever", busy_for_ever),
    _fault("The worker uses more memory", "worker too large", too_large),
    *(
        _fault(NONSENSE, f"worker sends {what}", lambda run, data=data: nonsense(data, run))
        for what, data in (
            ("noise", b"\xff\x13\x00" * 50),
            ("an endless length", b"\xff\xff\xff\x7f"),
            ("ready twice", b"\x07\x00\x00\x00\x91\xa5ready"),
            ("a message that is none", b"\x03\x00\x00\x00\x92\x01\x02"),
        )
    ),
    _fault(NONSENSE, "worker floods", flood),
    _fault("The worker does not read", "worker does not read", does_not_read, expected=drives_on()),
)
