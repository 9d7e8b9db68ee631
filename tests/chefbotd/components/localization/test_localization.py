"""Finding the way over the socket: the whole daemon, the real skill in the same process, scans of a simulated flat."""

import asyncio
import math
from pathlib import Path

import numpy as np
import pytest

from chefbotd.client.errors import CallError
from chefbotd.clock import run_virtual
from chefbotd.components.localization.skill_requests import POSE_FILE
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from tests.chefbotd.components.localization.algorithms.buildings import drawn
from tests.chefbotd.components.mapping.algorithms.slam.flat import furnished_flat, odometry
from tests.chefbotd.components.mapping.test_mapping import Workers, scene
from tests.chefbotd.components.worker.skills.drives import TRUTH


def stored(folder: Path) -> None:
    """The plan of the flat is in the store; nobody uses it yet."""
    save(MapStore(folder, 3), "flat", drawn(furnished_flat()))


def off_m(pose: Pose2D, k: int) -> float:
    """How far a pose is from where the robot was at scan ``k`` of the tour."""
    return math.dist((pose.x_m, pose.y_m), TRUTH[k][:2])


def test_it_finds_itself_on_the_map_that_is_loaded(tmp_path: Path) -> None:
    """load_map, and a short drive: the topic goes from unknown over searching to localized, and map_pose is right."""
    stored(tmp_path)

    async def play() -> None:
        async with scene(tmp_path) as s:
            assert (await s.data("localization")).state == "unknown"
            await s.client.call("load_map", name="flat")
            await s.drive(0, 30)
            told = await s.data("localization")
            assert (told.state, told.map, told.jumps, told.alternatives) == ("localized", "flat", 1, ())
            assert told.fit > 0.9
            assert (await s.data("map_pose")).state == "localized"
            assert off_m(s.poses[-1].map_from_base, 29) < 0.03
            place = await s.client.call("save_place", name="here")
            assert math.dist((place["x_m"], place["y_m"]), TRUTH[29][:2]) < 0.03

    run_virtual(play())


def test_load_map_ends_when_the_way_can_be_found_on_it_and_says_why_where_it_cannot(tmp_path: Path) -> None:
    """Its steps are told, and set_pose may follow at once; a map without walls is in use with a warning."""
    stored(tmp_path)
    save(MapStore(tmp_path, 3), "meadow", OccupancyGrid(0.05, Pose2D(), np.zeros((90, 70), np.int8)))

    async def play() -> None:
        async with scene(tmp_path) as s:
            told: list[str] = []
            used = await s.client.load_map("flat", on_progress=lambda *what: told.append(what[2]))
            assert used.warning is None
            assert told[-3:] == ["reading the map", "finding its walls", "preparing the search"]
            assert (await s.client.set_pose(*map(float, TRUTH[0]))).map == "flat"
            used = await s.client.load_map("meadow")
            assert used.warning is not None
            assert "the map 'meadow' cannot be used for localization" in used.warning
            told_of = await s.data("localization")
            assert (told_of.state, told_of.map) == ("unknown", None)

    run_virtual(play())


def test_map_from_odom_holds_when_odometry_begins_elsewhere(tmp_path: Path) -> None:
    """The odometry's origin lies at (3, -2), turned by 1 rad: with map_from_odom it makes the pose in the map."""
    stored(tmp_path)
    odom = Pose2D(3.0, -2.0, 1.0)

    async def play() -> None:
        async with scene(tmp_path) as s:
            await s.client.call("load_map", name="flat")
            await s.drive(0, 30, odom)
            last = s.poses[-1]
            driven = Pose2D(*map(float, odometry(TRUTH, 1)[29]))
            assert off_m(last.map_from_base, 29) < 0.03
            assert off_m(last.map_from_odom.compose(odom.inverse()).compose(driven), 29) < 0.03

    run_virtual(play())


@pytest.mark.slow
def test_the_pose_outlives_the_daemon(tmp_path: Path) -> None:
    """The next daemon uses the same map, tries the kept pose, and is right after three scans, without a search."""
    stored(tmp_path)

    async def play() -> None:
        async with scene(tmp_path) as s:
            await s.client.call("load_map", name="flat")
            await s.drive(0, 40)
        assert (tmp_path / POSE_FILE).is_file()
        async with scene(tmp_path) as s:
            assert (await s.data("localization")).state == "uncertain"
            await s.drive(40, 46)
            told = await s.data("localization")
            assert (told.state, told.searched) == ("localized", 0.0)
            assert off_m(s.poses[-1].map_from_base, 45) < 0.03

    run_virtual(play())


@pytest.mark.slow
def test_a_killed_worker_finds_itself_again(tmp_path: Path) -> None:
    """Killed in mid-drive, the next worker gets the map by itself and starts from the pose that was kept."""
    stored(tmp_path)
    workers = Workers()

    async def play() -> None:
        async with scene(tmp_path, workers.spawn) as s:
            await s.client.call("load_map", name="flat")
            await s.drive(0, 30)
            workers.children[-1].kill()
            await asyncio.sleep(0.1)
            told = await s.data("localization")
            assert (told.state, told.map) == ("unknown", None)
            assert told.reason.startswith("the worker is restarting: it was killed")
            await asyncio.sleep(2.0)
            assert len(workers.children) == 2
            await s.drive(30, 60)
            assert (await s.data("localization")).state == "localized"
            assert off_m(s.poses[-1].map_from_base, 59) < 0.03

    run_virtual(play())


@pytest.mark.slow
def test_it_rests_while_a_map_is_made(tmp_path: Path) -> None:
    """SLAM tells the pose then, and a pose that is given is refused; when that map is discarded, it goes on."""
    stored(tmp_path)

    async def play() -> None:
        async with scene(tmp_path) as s:
            await s.client.call("load_map", name="flat")
            await s.drive(0, 10)
            await s.client.call("start_mapping")
            await asyncio.sleep(0.2)
            s.poses.clear()
            await s.drive(10, 20)
            assert {pose.state for pose in s.poses} == {"mapping"}
            with pytest.raises(CallError, match="no finished map is in use"):
                await s.client.set_pose(2.0, 2.4, 0.3)
            await s.client.call("discard_mapping")
            await asyncio.sleep(0.2)
            await s.drive(20, 45)
            assert (await s.data("localization")).state == "localized"
            assert off_m(s.poses[-1].map_from_base, 44) < 0.03

    run_virtual(play())


def test_a_person_sets_the_pose_and_asks_for_a_search(tmp_path: Path) -> None:
    """set_pose is uncertain until confirmed, localize searches; both answer with the state at once."""
    stored(tmp_path)

    async def play() -> None:
        async with scene(tmp_path) as s:
            await s.client.call("load_map", name="flat")
            await asyncio.sleep(0.2)
            x, y, heading = map(float, TRUTH[0])
            assert (await s.client.set_pose(x + 0.2, y - 0.15, heading + 0.1)).state == "uncertain"
            await s.drive(0, 6)
            assert (await s.data("localization")).state == "localized"
            assert (await s.client.localize()).state == "searching"
            assert (await s.data("localization")).state == "searching"

    run_virtual(play())
