"""The real worker process: started, killed, stopped, orphaned. Without skills, so that it starts at once."""

import asyncio
import base64
import contextlib
import os
import signal
import socket
import subprocess
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest
import uvloop

from chefbotd.clock import SystemClock
from chefbotd.components.worker.messages import (
    FROM_WORKER,
    Configure,
    FrameReader,
    FromWorker,
    Ready,
    pack_body,
)
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.process import Worker, WorkerStatus
from chefbotd.components.worker.spawn import environment
from chefbotd.components.worker.watch import WorkerState
from tests.budget import sample
from tests.waiting import PATIENCE_S, until, wait_until

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc"),
]


@contextlib.asynccontextmanager
async def running(
    parameters: WorkerParameters | None = None,
) -> AsyncIterator[tuple[Worker, list[WorkerStatus]]]:
    """A real worker that is ready."""
    statuses: list[WorkerStatus] = []
    worker = Worker(
        parameters or WorkerParameters(silence_timeout_s=60.0), SystemClock(), {}, statuses.append
    )
    task = asyncio.create_task(worker.run())
    try:
        await until(lambda: worker.is_ready)
        yield worker, statuses
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


def run(scene: Callable[[], object]) -> None:
    """On the loop that the daemon runs on."""
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(scene())  # type: ignore[arg-type]


def out_of_memory_score(pid: int) -> int:
    """How gladly the kernel ends it when memory is out; the daemon's is 0."""
    return int(Path(f"/proc/{pid}/oom_score_adj").read_text())


def lives(pid: int) -> bool:
    """Whether there is such a process, and it is no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_it_runs_behind_the_daemon_and_leaves_with_it() -> None:
    """It has a lower priority, is the kernel's first choice when memory is out, and is gone when the daemon ends."""
    pids: list[int] = []

    async def scene() -> None:
        async with running() as (worker, _):
            pid = worker.memory.status.pid or 0
            pids.append(pid)
            mine = os.getpriority(os.PRIO_PROCESS, 0)
            assert os.getpriority(os.PRIO_PROCESS, pid) == min(mine + 10, 19)
            assert out_of_memory_score(pid) == 800
            await until(lambda: worker.memory.status.rss_mb is not None)
            assert 5 < (worker.memory.status.rss_mb or 0) < 100, "without skills it has loaded no arrays"

    run(scene)
    assert not lives(pids[0])


def test_killed_it_is_back_within_seconds() -> None:
    """Kill -9: the reason names the signal, and another one is ready."""

    async def scene() -> None:
        async with running() as (worker, statuses):
            first = worker.memory.status.pid or 0
            os.kill(first, signal.SIGKILL)
            await until(lambda: worker.memory.status.restarts == 1 and worker.is_ready)
            assert worker.memory.status.pid != first
            assert "it was killed by SIGKILL" in [status.reason for status in statuses]

    run(scene)


def test_stopped_it_is_taken_for_hung() -> None:
    """SIGSTOP: silence is noticed, the stopped process is ended, and another one is ready."""

    async def scene() -> None:
        async with running(WorkerParameters(silence_timeout_s=1.5)) as (worker, statuses):
            first = worker.memory.status.pid or 0
            os.kill(first, signal.SIGSTOP)
            await until(
                lambda: worker.memory.status.restarts >= 1 and worker.is_ready
            )  # a busy one may seem silent, too
            assert not lives(first)
            assert any("silent" in status.reason for status in statuses)

    run(scene)


def test_a_bound_of_memory_is_held() -> None:
    """What takes more than it may is ended, with both figures."""
    tight = WorkerParameters().model_copy(update={"max_memory_mb": 10.0})

    async def scene() -> None:
        statuses: list[WorkerStatus] = []
        worker = Worker(tight, SystemClock(), {}, statuses.append)
        task = asyncio.create_task(worker.run())
        await until(lambda: any(status.state is WorkerState.RESTARTING for status in statuses))
        ended = next(status for status in statuses if status.state is WorkerState.RESTARTING)
        assert "MB of memory; 10 MB are allowed" in ended.reason
        task.cancel()
        await asyncio.wait({task})

    run(scene)


DAEMON = """
import asyncio, sys
from chefbotd.clock import SystemClock
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.process import Worker
from chefbotd.components.worker.watch import WorkerState
def tell(status):
    if status.state is WorkerState.READY:
        print(status.pid, flush=True)
asyncio.run(Worker(WorkerParameters(), SystemClock(), {}, tell).run())
"""


@pytest.mark.parametrize("stopped", sample([False, True]))
def test_it_dies_with_a_daemon_that_is_killed(stopped: bool) -> None:
    """Kill -9 of the daemon leaves no worker behind, not even a stopped one."""
    with subprocess.Popen([sys.executable, "-c", DAEMON], stdout=subprocess.PIPE, text=True) as daemon:
        assert daemon.stdout is not None
        pid = int(daemon.stdout.readline())
        if stopped:
            os.kill(pid, signal.SIGSTOP)
        daemon.kill()
    wait_until(lambda: not lives(pid))


def test_a_process_that_begins_anew_knows_its_configuration() -> None:
    """It is ready without having been told anything, and as nice as before: the daemon notices nothing."""
    ours, theirs = socket.socketpair()
    known = base64.b64encode(pack_body(Configure({}))).decode()
    descriptor = theirs.fileno()
    command = [
        sys.executable,
        "-m",
        "chefbotd.components.worker",
        str(descriptor),
        str(os.getpid()),
        "0",
        known,
    ]
    with ours, theirs, subprocess.Popen(command, pass_fds=(descriptor,)) as process:
        theirs.close()
        ours.settimeout(PATIENCE_S)
        reader, told = FrameReader(), list[FromWorker]()
        while Ready() not in told:
            told += [FROM_WORKER.decode(frame) for frame in reader.feed(ours.recv(65536))]
        assert os.getpriority(os.PRIO_PROCESS, process.pid) == os.getpriority(os.PRIO_PROCESS, 0)
        ours.close()


def test_compiled_code_goes_where_the_service_may_write() -> None:
    """[worker] cache_folder, else NUMBA_CACHE_DIR, else systemd's CacheDirectory=; nothing of systemd's own goes on."""
    unit = {
        "CACHE_DIRECTORY": "/var/cache/chefbotd:/var/cache/other",
        "NOTIFY_SOCKET": "/run/x",
        "PATH": "/bin",
    }
    assert environment(unit, None)["NUMBA_CACHE_DIR"] == "/var/cache/chefbotd/numba"
    assert environment(unit, Path("/srv/numba"))["NUMBA_CACHE_DIR"] == "/srv/numba"
    assert environment({"NUMBA_CACHE_DIR": "/n", **unit}, None)["NUMBA_CACHE_DIR"] == "/n"
    assert "NUMBA_CACHE_DIR" not in environment({}, None)
    assert "NOTIFY_SOCKET" not in environment(unit, None)
    assert environment(unit, None)["OPENBLAS_NUM_THREADS"] == "1"


def test_the_workers_clock_is_the_daemons() -> None:
    """Stamps of both mean the same; and the worker loads no event loop, which would take 7 MB."""
    program = (
        "import sys, chefbotd.components.worker.main as main, chefbotd.components.worker.runner;"
        "print('asyncio' in sys.modules, main._Clock().now_s())"
    )
    before_s = SystemClock().now_s()
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded, now = done.stdout.split()
    assert loaded == "False"
    assert before_s <= float(now) <= SystemClock().now_s()
