"""A recorded drive to goals, replayed without a worker: scans, poses, paths and twists are the same, bit for bit."""

import asyncio
import contextlib
from pathlib import Path
from typing import Any

import pytest

from chefbotd.client import GoalCancelled, GoalFault
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.spawn import Child
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot
from chefbotd.testing.worker import worker_in_process
from tests.chefbotd.components.recording.replay.recordings import recorded, replayed

START = {"sim.world.start_x_m": 2.45, "sim.world.start_y_m": 2.6, "sim.world.start_heading_rad": 2.1}

pytestmark = pytest.mark.slow


def test_a_drive_to_goals_is_replayed_bit_for_bit_without_a_worker(tmp_path: Path) -> None:
    """A place, a zone drawn on the way, a goal given up, a worker killed, an e-stop: the worker's part is recorded."""
    save(MapStore(tmp_path, 3), "flat", FLAT.grid())
    children: list[Child] = []

    async def spawn(theirs: Any, parameters: WorkerParameters) -> Child:
        children.append(await worker_in_process(theirs, parameters))
        return children[-1]

    async def script(robot: SimulatedRobot) -> None:
        client = robot.client
        await asyncio.sleep(1.5)
        await client.load_map("flat")
        async with asyncio.timeout(15.0), client.subscribe("localization") as events:
            async for event in events:
                if event.data.state == "localized":
                    break
        await client.save_place("hall", x_m=2.6, y_m=4.0, heading_rad=0.4)
        goal = asyncio.create_task(client.navigate_to(place="hall"))
        await asyncio.sleep(3.1)
        await client.save_zone([[7, 6], [7.4, 6], [7.4, 6.4]], name="rug", confirmed=True)
        await client.cancel_navigation()
        with contextlib.suppress(GoalCancelled):
            await goal
        goal = asyncio.create_task(client.navigate_to(x_m=2.7, y_m=2.3, heading_rad=-1.2))
        await asyncio.sleep(2.3)
        children[-1].kill()
        await asyncio.sleep(4.0)
        await client.estop("enough")
        with contextlib.suppress(GoalFault):
            await goal
        await asyncio.sleep(0.5)

    settings = load(packaged("chefbot_lidar"), overrides={"maps.folder": str(tmp_path), **START})
    events = recorded(script, settings, spawn)
    (tmp_path / "flat.map").rename(tmp_path / "gone")  # a replay does not read it
    outcome = replayed(events, settings)
    assert outcome.problems == []
    assert outcome.first is None, str(outcome.first)
    counted = outcome.comparison.counts
    assert counted["ScanMeasured"] > 50
    assert counted["MapPoseUpdated"] > 30
    assert counted["NavigationChanged"] > 4
    assert {"PathChanged", "LocalizationChanged", "WorkerReported", "MapLoaded"} <= counted.keys()
