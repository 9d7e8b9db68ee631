"""Driving to goals in the simulated flat: zones, other maps, and a pose that is not known."""

import asyncio
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chefbotd.client import CallError, GoalFault, GoalUnreachable
from chefbotd.clock import run_virtual
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import simulated_robot
from chefbotd.testing.worker import worker_in_process
from tests.scenarios.on_the_way import GOAL, Drive, drives_in_flat

pytestmark = pytest.mark.slow


@drives_in_flat()
async def test_another_map_ends_the_goal(drive: Drive) -> None:
    """The same flat under another name, loaded in mid-drive: its coordinates need not be the same."""
    save(MapStore(drive.folder, 3), "other", FLAT.grid())
    leg = drive.begin()
    await drive.until_driving()
    await drive.client.load_map("other")
    with pytest.raises(GoalFault, match="the map was changed from flat to other"):
        await leg
    await asyncio.sleep(1.0)
    assert drive.speed_m_s < 0.005


@drives_in_flat()
async def test_the_map_in_use_is_deleted_in_mid_drive(drive: Drive) -> None:
    """At rest, and the goal ends with a sentence; so does the next one, before anything moves."""
    leg = drive.begin()
    await drive.until_driving()
    await drive.client.delete_map("flat")
    with pytest.raises(GoalFault, match="no map in use"):
        await leg
    await asyncio.sleep(1.0)
    assert drive.speed_m_s < 0.005
    with pytest.raises(CallError, match="no finished map is in use"):
        await drive.begin()


DOOR_ZONE = "keep_out:\n  - {name: door, corners_m: [[1.8, 3.1], [2.9, 3.1], [2.9, 3.6], [1.8, 3.6]]}\n"


@drives_in_flat(zones=DOOR_ZONE)
async def test_a_zone_not_to_be_entered_is_kept_out_of(drive: Drive) -> None:
    """The middle of the door as keep-out: the hall is not reached through it, and no way leads into the zone."""
    plan = await drive.client.plan_to(**GOAL)
    assert not plan.possible or all(
        not 3.0 < y < 3.6 or x > 2.9 for x, y in zip(plan.x_m, plan.y_m, strict=True)
    )
    assert not plan.possible or plan.length_m > 5.0
    with pytest.raises(GoalUnreachable):
        await drive.begin(x_m=2.3, y_m=3.3)


@drives_in_flat()
async def test_zones_that_change_in_mid_drive_hold_when_the_map_is_loaded_again(drive: Drive) -> None:
    """The door becomes keep-out while the robot drives to it: it drives on to no other end than that no way is left."""
    leg = drive.begin()
    await drive.until_driving()
    zones = "keep_out:\n  - {name: door, corners_m: [[0.0, 3.1], [9.0, 3.1], [9.0, 3.6], [0.0, 3.6]]}\n"
    (drive.folder / "flat.map" / "zones.yaml").write_text(zones)
    await drive.client.load_map("flat")
    assert (await drive.client.get_state()).topics["localization"].data.state == "localized"
    with pytest.raises(GoalUnreachable):
        await leg
    assert drive.truth.world_from_base.y_m < 3.1 - 0.15
    (drive.folder / "flat.map" / "zones.yaml").unlink()
    await drive.client.load_map("flat")
    assert "reached" in await drive.begin()


@drives_in_flat()
async def test_a_map_that_is_renamed_in_mid_drive_is_the_same_map(drive: Drive) -> None:
    """Twice in a row: the goal goes on and is reached, the pose stays known, and the state has the new name."""
    leg = drive.begin()
    await drive.until_driving()
    await drive.client.rename_map("flat", "home")
    await drive.client.rename_map("home", "our flat")
    await asyncio.sleep(1.0)
    known = (await drive.client.get_state()).topics["localization"].data
    assert (known.state, known.map) == ("localized", "our flat")
    assert "reached" in await leg
    assert drive.off()[0] < 0.04
    assert not any("lost" in event.reason or event.state == "fault" for event in drive.told)


@drives_in_flat()
async def test_a_map_that_is_renamed_while_the_worker_is_away_is_the_same_map(drive: Drive) -> None:
    """The next worker has it under its new name, tries the pose that was kept, and the goal goes on."""
    leg = drive.begin()
    await drive.until_driving()
    drive.children[-1].kill()
    await asyncio.sleep(0.1)
    await drive.client.rename_map("flat", "home")
    assert "reached" in await leg
    known = (await drive.client.get_state()).topics["localization"].data
    assert (known.state, known.map) == ("localized", "home")


@drives_in_flat(zones="keep_out: [stairs]")
async def test_zones_that_cannot_be_read_let_nothing_drive(drive: Drive) -> None:
    """A file that is no zones: where not to go is not known, so goals are refused, and why is said."""
    with pytest.raises(CallError, match="the zones of the map cannot be read") as refused:
        await drive.begin()
    assert refused.value.kind == "no_map_loaded"
    loaded = await drive.client.load_map("flat")
    assert "the zones of the map cannot be read: zones.yaml: keep_out" in str(loaded.warning)


@drives_in_flat()
async def test_a_pose_that_is_set_into_a_wall_does_not_end_the_goal(drive: Drive) -> None:
    """It is uncertain, and from there is no way: the robot stands, scans put the pose right, and the goal is reached."""
    leg = drive.begin()
    await drive.until_driving()
    assert (await drive.client.set_pose(3.2, 3.35)).state == "uncertain"
    assert "reached" in await leg
    assert drive.off()[0] < 0.04


BLIND_BEHIND = [
    {"name": "lidar", "model": "ld19", "device": "/dev/lidar", "blind_sectors_rad": [[1.7, -1.7]]}
]


def twin_rooms() -> OccupancyGrid:
    """Two rooms of 3.1 by 2.7 m that are the same but for a recess in the north wall of the eastern one.

    A shelf, a post and a slanted board tell the directions apart.
    """
    percent = np.full((80, 140), 100, np.int8)
    for left in (6, 74):
        percent[10:64, left : left + 62] = 0
        percent[10:16, left + 4 : left + 24] = 100
        percent[24:27, left + 50 : left + 53] = 100
        for k in range(14):
            percent[10 + k, left + 46 + k : left + 62] = 100
    percent[64:74, 84:114] = 0
    return OccupancyGrid(0.05, Pose2D(-1.0, -0.5), percent)


def rooms(known: Any) -> set[str]:
    """In which of the two rooms the robot may be."""
    return {"west" if place.x_m < 2.5 else "east" for place in known.alternatives}


@pytest.mark.parametrize(
    ("asked", "allowed"),
    [pytest.param(True, False, id="asked"), pytest.param(False, True, id="allowed"), (False, False)],
)
def test_of_rooms_that_look_alike_a_turn_tells_which_only_if_asked_or_allowed(
    tmp_path: Path, *, asked: bool, allowed: bool
) -> None:
    """The lidar sees nothing behind, where the rooms differ: both are named until the robot has turned."""
    save(MapStore(tmp_path, 3), "twins", twin_rooms())
    world = {"map_path": str(tmp_path / "twins.yaml"), "start_x_m": 4.3, "start_y_m": 1.6}
    overrides = {
        "maps.folder": str(tmp_path),
        "lidar": BLIND_BEHIND,
        **{f"sim.world.{key}": value for key, value in world.items()},
        "sim.world.start_heading_rad": -1.45,
        "localization.turn_at_start": allowed,
    }

    async def run() -> None:
        async with simulated_robot(
            load(packaged("chefbot_lidar"), overrides=overrides), spawn_worker=worker_in_process
        ) as robot:
            await asyncio.sleep(1.5)
            await robot.client.load_map("twins")
            began = robot.board.truth(asyncio.get_running_loop().time()).world_from_base
            await asyncio.sleep(2.5)
            known = (await robot.client.get_state()).topics["localization"].data
            assert (known.state, rooms(known)) == ("searching", {"west", "east"}), known
            if asked:
                found = await robot.client.localize(turn=True)
                assert (found.state, found.reason) == ("localized", "it knows where it is")
            else:
                await asyncio.sleep(25.0)
            known = (await robot.client.get_state()).topics["localization"].data
            truth = robot.board.truth(asyncio.get_running_loop().time()).world_from_base
            if asked or allowed:
                assert known.state == "localized"
                pose = (await robot.client.get_state()).topics["map_pose"].data
                assert math.dist((pose.x_m, pose.y_m), (truth.x_m, truth.y_m)) < 0.06
            else:
                assert (known.state, rooms(known)) == ("searching", {"west", "east"})
                assert math.dist((began.x_m, began.y_m), (truth.x_m, truth.y_m)) < 1e-6
                assert began.heading_rad == pytest.approx(truth.heading_rad, abs=1e-6)

    run_virtual(run())
