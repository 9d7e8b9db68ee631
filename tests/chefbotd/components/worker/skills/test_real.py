"""The real worker with the real skill and the real disk, killed at any moment: what was saved is whole."""

import asyncio
import contextlib
import os
import random
import signal
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import TypeVar

import pytest
import uvloop

from chefbotd.clock import SystemClock
from chefbotd.components.mapping.algorithms.parameters import MappingParameters
from chefbotd.components.mapping.algorithms.saved import restore_state
from chefbotd.components.mapping.skill_requests import (
    SKILL,
    Finish,
    MappingSkillParameters,
    ResumeMapping,
    Start,
)
from chefbotd.components.maps.events import MapChanged, MappingChanged, MapSaved
from chefbotd.components.maps.storage import contents
from chefbotd.components.maps.storage.manifest import GRAPH
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.process import Worker
from chefbotd.components.worker.requests import WorkerLost
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import MapPoseUpdated, OdometryUpdated
from tests.chefbotd.components.worker.skills.drives import measured
from tests.waiting import PATIENCE_S, until

pytestmark = pytest.mark.realtime
T = TypeVar("T")


class Bench:
    """A real worker that maps, fed ten times as fast as in life, in its own time."""

    def __init__(self, folder: Path, autosave_period_s: float) -> None:
        parameters = MappingSkillParameters(
            lidars=("top",),
            folder=folder,
            versions_kept=3,
            session="one",
            mapping=MappingParameters(autosave_period_s=autosave_period_s, publish_period_s=0.2),
        )
        skills = {SKILL: parameters.model_dump_json().encode()}
        bounds = WorkerParameters(restart_delay_s=0.05, max_memory_mb=2000, silence_timeout_s=60.0)
        self.worker = Worker(bounds, SystemClock(), skills, lambda status: None)
        for kind in (MapPoseUpdated, MappingChanged, MapChanged):
            self.worker.add_listener(SKILL, kind, lambda event: None)

    async def ask(self, request: Start | ResumeMapping) -> MappingChanged:
        """Have something done."""
        return await self.worker.request(SKILL, request, MappingChanged, deadline_s=PATIENCE_S)

    async def drive(self, first: int, last: int) -> None:
        """A part of the tour."""
        now_s = SystemClock().now_s()
        for message in measured(first, last, begin_s=now_s - 0.1 * first - 60.0):
            self.worker.send(message)
            if isinstance(message, OdometryUpdated):
                await asyncio.sleep(0.004)
            assert isinstance(message, ScanMeasured | OdometryUpdated)
        await asyncio.sleep(0.1)


@contextlib.asynccontextmanager
async def running(folder: Path, autosave_period_s: float = 0.1) -> AsyncIterator[Bench]:
    """A bench whose worker is ready."""
    bench = Bench(folder, autosave_period_s)
    task = asyncio.create_task(bench.worker.run())
    try:
        await until(lambda: bench.worker.is_ready)
        yield bench
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


def run(scene: Callable[[], object]) -> None:
    """On the loop that the daemon runs on."""
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(scene())  # type: ignore[arg-type]


@pytest.mark.slow
def test_killed_at_any_moment_what_was_saved_is_whole(tmp_path: Path) -> None:
    """Killed four times while it saves ten times a second: each time the last autosave is whole, and mapping goes on."""
    chance = random.Random(7)

    async def scene() -> None:
        async with running(tmp_path) as bench:
            await bench.ask(Start())
            at, kept = 0, 0
            for _ in range(4):
                feeding = asyncio.create_task(bench.drive(at, at + 40))
                await until(lambda: MapStore(tmp_path).read_autosave() is not None)
                await asyncio.sleep(chance.uniform(0.1, 0.45))
                restarts, pid = bench.worker.memory.status.restarts, bench.worker.memory.status.pid
                assert pid is not None
                os.kill(pid, signal.SIGKILL)
                await feeding
                at += 40
                await until(
                    lambda was=restarts: bench.worker.is_ready and bench.worker.memory.status.restarts > was
                )
                found = MapStore(tmp_path).read_autosave()
                assert found is not None, "it is saved with its first scans"
                nodes = restore_state(contents.read_arrays(found.folder / GRAPH)).nodes
                assert len(nodes) >= kept
                kept = len(nodes)
                status = await bench.ask(ResumeMapping(paused=False))
                assert (status.state, status.keyframes) == ("mapping", kept)
            await bench.drive(at, at + 20)
            saved = await bench.worker.request(SKILL, Finish("flat"), MapSaved, deadline_s=PATIENCE_S)
            assert saved.keyframes >= kept
        assert MapStore(tmp_path).names() == ["flat"]
        assert MapStore(tmp_path).read_autosave() is None

    run(scene)


@pytest.mark.slow
def test_killed_while_it_finishes_the_map_is_there_or_goes_on(tmp_path: Path) -> None:
    """Killed at three moments of finishing: a saved map is whole, and without one mapping goes on from the autosave."""

    async def scene() -> None:
        async with running(tmp_path) as bench:
            for k in range(3):
                store = MapStore(tmp_path)
                if store.read_autosave() is None:
                    await bench.ask(Start())
                await bench.drive(60 * k, 60 * k + 60)
                await until(lambda store=store: store.read_autosave() is not None)
                before = len(store.describe("flat").versions) if "flat" in store.names() else 0
                asking = asyncio.create_task(
                    bench.worker.request(SKILL, Finish("flat"), MapSaved, deadline_s=PATIENCE_S)
                )
                await asyncio.sleep(0.06 * k)
                restarts, pid = bench.worker.memory.status.restarts, bench.worker.memory.status.pid
                assert pid is not None
                os.kill(pid, signal.SIGKILL)
                with contextlib.suppress(WorkerLost):
                    await asking
                await until(
                    lambda was=restarts: bench.worker.is_ready and bench.worker.memory.status.restarts > was
                )
                names = store.names()
                saved = "flat" in names and len(store.describe("flat").versions) > before
                if saved:
                    assert contents.read_slam(store, "flat") is not None
                    assert not store.describe("flat").damage
                else:
                    assert store.read_autosave() is not None
                if store.read_autosave() is not None:
                    assert (await bench.ask(ResumeMapping(paused=False))).state == "mapping"

    run(scene)


@pytest.mark.slow
def test_compiling_for_the_first_time_leaves_no_memory_behind(tmp_path: Path) -> None:
    """With an empty cache the worker compiles, begins anew as the same process, and takes what a warm one takes."""
    parameters = MappingSkillParameters(
        lidars=("top",), folder=tmp_path / "maps", versions_kept=1, session="one", mapping=MappingParameters()
    )
    bounds = WorkerParameters(cache_folder=tmp_path / "cache", start_timeout_s=600.0)

    async def scene() -> None:
        pids: set[int] = set()
        worker = Worker(
            bounds,
            SystemClock(),
            {SKILL: parameters.model_dump_json().encode()},
            lambda status: pids.add(status.pid) if status.pid else None,
        )
        task = asyncio.create_task(worker.run())
        async with asyncio.timeout(600.0):
            while not worker.is_ready or worker.memory.status.rss_mb is None:  # noqa: ASYNC110 - another process
                await asyncio.sleep(0.1)
        await asyncio.sleep(2.0)
        assert worker.memory.status.restarts == 0
        assert len(pids) == 1
        assert worker.memory.status.rss_mb is not None
        assert worker.memory.status.rss_mb < 120.0
        task.cancel()
        await asyncio.wait({task})

    run(scene)
