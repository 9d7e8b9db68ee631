"""Driving to goals in the simulated flat: daemon, lidar and worker on one virtual clock, held against the truth."""

import asyncio
import base64
import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chefbotd.client import CallError, GoalCancelled, GoalFault, GoalUnreachable
from chefbotd.clock import run_virtual
from chefbotd.core.geometry import Pose2D
from chefbotd.mapping.occupancy_grid import OccupancyGrid
from chefbotd.maps.contents import save
from chefbotd.maps.store import MapStore
from chefbotd.settings import load, packaged
from chefbotd.sim.lidar import LidarFault
from chefbotd.sim.worlds.flat import FLAT
from chefbotd.testing.daemon import simulated_robot
from chefbotd.testing.worker import worker_in_process
from tests.scenarios.on_the_way import GOAL, Drive, in_flat

pytestmark = pytest.mark.slow


def test_a_leg_ends_where_it_was_asked_for(tmp_path: Path) -> None:
    """Through a door: within 4 cm and 3 degrees by the truth, and told before with length and time."""

    async def scenario(drive: Drive) -> None:
        plan = await drive.client.plan_to(**GOAL)
        assert plan.possible
        assert plan.length_m == pytest.approx(math.dist((2.45, 2.6), (2.6, 4.0)), rel=0.15)
        assert drive.speed_m_s < 0.005
        assert "reached" in await drive.begin()
        off_m, off_rad = drive.off()
        assert off_m < 0.04
        assert off_rad < math.radians(3)
        states = [event.state for event in drive.told]
        assert states[-1] == "reached"
        assert "driving" in states
        assert "navigation" in {event.source for event in drive.safety}

    in_flat(tmp_path, scenario)


def test_a_goal_in_a_wall_is_unreachable_and_nothing_moves(tmp_path: Path) -> None:
    """The wall between living room and hall; the nearest free place is offered, not driven to."""

    async def scenario(drive: Drive) -> None:
        with pytest.raises(GoalUnreachable, match="the nearest place that can be reached"):
            await drive.begin(x_m=3.2, y_m=3.35)
        assert drive.off()[0] > 1.2

    in_flat(tmp_path, scenario)


def test_a_killed_worker_leaves_the_robot_standing_and_the_next_one_goes_on(tmp_path: Path) -> None:
    """At rest within the dead-man and the ramp; told why; then the goal is reached all the same."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        drive.children[-1].kill()
        await asyncio.sleep(0.5 + 0.5)
        assert drive.speed_m_s < 0.005
        paused = next(event for event in drive.told if event.state == "paused")
        assert "waits until its worker is back: it was killed" in paused.reason
        assert "reached" in await leg
        assert len(drive.children) == 2

    in_flat(tmp_path, scenario)


def test_teleop_takes_over_at_once_and_the_goal_goes_on(tmp_path: Path) -> None:
    """A person backs the robot up for a second: navigation is paused meanwhile, and reaches its goal then."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        before = len(drive.safety)
        for _ in range(10):
            await drive.client.drive(-0.05, 0.0, "teleop")
            await asyncio.sleep(0.1)
            assert drive.safety[-1].source == "teleop"
        assert drive.safety[before].source == "teleop"
        assert drive.told[-1].state == "paused"
        assert "reached" in await leg

    in_flat(tmp_path, scenario)


def test_a_stop_cancels_the_goal(tmp_path: Path) -> None:
    """Somebody sends stop: the robot comes to rest, the goal ends, and says by whom."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        await drive.client.stop()
        with pytest.raises(GoalCancelled, match="navigation was stopped by"):
            await leg
        await asyncio.sleep(1.0)
        assert drive.speed_m_s < 0.005

    in_flat(tmp_path, scenario)


def test_a_stop_during_a_pause_cancels_the_goal_too(tmp_path: Path) -> None:
    """Navigation has wished nothing for 2 s; after a stop, neither time nor ``resume`` make it go on."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        await drive.client.call("pause_navigation")
        await asyncio.sleep(2.0)
        await drive.client.stop()
        with pytest.raises(GoalCancelled, match="navigation was stopped by"):
            await leg
        await drive.client.call("resume_navigation")
        await asyncio.sleep(2.0)
        assert drive.speed_m_s < 0.005

    in_flat(tmp_path, scenario)


def test_an_estop_ends_the_goal_as_a_fault(tmp_path: Path) -> None:
    """And a goal is refused until the robot is armed again."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        await drive.client.estop("a child")
        with pytest.raises(GoalFault, match="a child"):
            await leg
        with pytest.raises(CallError, match="send 'arm' first"):
            await drive.begin()
        await drive.client.arm()
        assert "reached" in await drive.begin()

    in_flat(tmp_path, scenario)


def test_giving_up_the_request_stands_the_robot(tmp_path: Path) -> None:
    """Ctrl-C in a program that waits: at rest within half a second, and the goal is cancelled."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        leg.cancel()
        await asyncio.sleep(0.6)
        assert drive.speed_m_s < 0.01
        assert drive.told[-1].state == "cancelled"

    in_flat(tmp_path, scenario)


def test_whoever_looks_sees_the_costs_and_what_is_not_on_the_map(tmp_path: Path) -> None:
    """A disc of 0.25 m that no map shows: among the obstacles, and blocked in the costs, while the robot stands."""

    async def scenario(drive: Drive) -> None:
        here = drive.truth.world_from_base
        x, y = here.x_m, here.y_m + 0.9
        drive.robot.board.crowd.put("somebody", x, y)
        await asyncio.sleep(1.0)
        async with drive.client.subscribe("obstacles") as events:
            async for event in events:
                near = [
                    math.dist((x, y), point) for point in zip(event.data.x_m, event.data.y_m, strict=True)
                ]
                if any(abs(away_m - 0.25) < 0.06 for away_m in near):
                    break
        cells = np.full(FLAT.grid().percent.shape, -1, np.int8)
        async with drive.client.subscribe("costmap", policy="ordered") as parts:
            async for part in parts:
                data = part.data
                shape, packed = (data.part_rows, data.part_columns), base64.b64decode(data.cells)
                content = np.frombuffer(zlib.decompress(packed), np.int8).reshape(shape)
                cells[data.row : data.row + shape[0], data.column : data.column + shape[1]] = content
                if (cells >= 0).all():
                    break
        origin = FLAT.grid().map_from_grid
        row, column = (
            int((y - 0.25 - origin.y_m) / data.resolution_m),
            int((x - origin.x_m) / data.resolution_m),
        )
        assert cells[row, column] == 100
        assert cells[int((here.y_m - origin.y_m) / data.resolution_m), column] < 100

    in_flat(tmp_path, scenario)


def test_somebody_who_steps_in_front_is_not_touched(tmp_path: Path) -> None:
    """A disc of 0.25 m appears 0.6 m ahead of the outline in the door; when it leaves, the goal is reached."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        here = drive.truth.world_from_base
        drive.robot.board.crowd.put("somebody", here.x_m, here.y_m + 0.18 + 0.25 + 0.6)
        await asyncio.sleep(8.0)
        assert not drive.truth.in_contact
        assert not leg.done()
        drive.robot.board.crowd.take_away("somebody")
        assert "reached" in await leg

    in_flat(tmp_path, scenario)


@pytest.mark.parametrize("fault", [LidarFault.SILENT, LidarFault.FROZEN])
def test_without_scans_the_robot_stands_and_the_goal_ends(tmp_path: Path, fault: LidarFault) -> None:
    """The lidar falls silent or repeats itself in mid-drive: at rest within 2 s, a fault after 10 s more."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        drive.robot.lidars["lidar"].runner.fault = fault
        await asyncio.sleep(2.0)
        assert drive.speed_m_s < 0.005
        with pytest.raises(GoalFault, match="no scan arrived"):
            await leg

    in_flat(tmp_path, scenario)


def test_another_map_ends_the_goal(tmp_path: Path) -> None:
    """The same flat under another name, loaded in mid-drive: its coordinates need not be the same."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        await drive.client.load_map("other")
        with pytest.raises(GoalFault, match="the map was changed from flat to other"):
            await leg
        await asyncio.sleep(1.0)
        assert drive.speed_m_s < 0.005

    save(MapStore(tmp_path, 3), "other", FLAT.grid())
    in_flat(tmp_path, scenario)


def test_a_zone_not_to_be_entered_is_kept_out_of(tmp_path: Path) -> None:
    """The middle of the door as keep-out: the hall is not reached through it, and no way leads into the zone."""

    async def scenario(drive: Drive) -> None:
        plan = await drive.client.plan_to(**GOAL)
        assert not plan.possible or all(
            not 3.0 < y < 3.6 or x > 2.9 for x, y in zip(plan.x_m, plan.y_m, strict=True)
        )
        assert not plan.possible or plan.length_m > 5.0
        with pytest.raises(GoalUnreachable):
            await drive.begin(x_m=2.3, y_m=3.3)

    zones = "keep_out:\n  - {name: door, corners_m: [[1.8, 3.1], [2.9, 3.1], [2.9, 3.6], [1.8, 3.6]]}\n"
    in_flat(tmp_path, scenario, zones=zones)


def test_zones_that_change_in_mid_drive_hold_when_the_map_is_loaded_again(tmp_path: Path) -> None:
    """The door becomes keep-out while the robot drives to it: it drives on to no other end than that no way is left."""

    async def scenario(drive: Drive) -> None:
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

    in_flat(tmp_path, scenario)


def test_zones_that_cannot_be_read_let_nothing_drive(tmp_path: Path) -> None:
    """A file that is no zones: where not to go is not known, so goals are refused, and why is said."""

    async def scenario(drive: Drive) -> None:
        with pytest.raises(CallError, match="the zones of the map cannot be read") as refused:
            await drive.begin()
        assert refused.value.kind == "no_map_loaded"
        loaded = await drive.client.load_map("flat")
        assert "the zones of the map cannot be read: zones.yaml: keep_out" in str(loaded.warning)

    in_flat(tmp_path, scenario, zones="keep_out: [stairs]")


def test_somebody_who_walks_across_is_not_touched(tmp_path: Path) -> None:
    """A disc of 0.25 m crosses the way in the hall at 0.3 m/s and waits for nobody; the goal is reached behind it."""

    async def scenario(drive: Drive) -> None:
        leg, crowd = drive.begin(), drive.robot.board.crowd
        await drive.until_driving()
        least_m = math.inf
        for step in range(200):
            x, y = 0.9 + 0.3 * 0.05 * step, 3.95
            crowd.put("somebody", x, y)
            await asyncio.sleep(0.05)
            pose = drive.truth.world_from_base
            least_m = min(least_m, math.dist((pose.x_m, pose.y_m), (x, y)) - 0.25 - 0.18)
            assert not drive.truth.in_contact
        crowd.take_away("somebody")
        assert least_m > 0.02
        assert "reached" in await leg

    in_flat(tmp_path, scenario)


def test_a_board_that_is_silent_for_a_second_loses_nobody(tmp_path: Path) -> None:
    """An echo that is missing silences the classic board: the gate brakes, and the goal goes on without being lost."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        feed, drive.robot.device.feed = drive.robot.device.feed, lambda data: None  # type: ignore[method-assign]
        await asyncio.sleep(1.0)
        drive.robot.device.feed = feed  # type: ignore[method-assign]
        assert "reached" in await leg
        assert not any("does not know where it is" in event.reason for event in drive.told)

    in_flat(tmp_path, scenario)


def test_a_pose_that_is_set_into_a_wall_does_not_end_the_goal(tmp_path: Path) -> None:
    """It is uncertain, and from there is no way: the robot stands, scans put the pose right, and the goal is reached."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        assert (await drive.client.set_pose(3.2, 3.35)).state == "uncertain"
        assert "reached" in await leg
        assert drive.off()[0] < 0.04

    in_flat(tmp_path, scenario)


def test_a_lidar_that_is_off_for_a_while_makes_it_wait(tmp_path: Path) -> None:
    """Four seconds: it stands, and then the goal is reached; meanwhile nobody is told that it is localized."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        runner = drive.robot.lidars["lidar"].runner
        runner.fault = LidarFault.SILENT
        await asyncio.sleep(4.0)
        assert drive.speed_m_s < 0.005
        known = (await drive.client.get_state()).topics["localization"].data
        assert (known.state, known.reason) == ("uncertain", "no scan of the lidar 'lidar' for 4 s")
        runner.fault = None
        assert "reached" in await leg

    in_flat(tmp_path, scenario)


def test_the_map_in_use_is_deleted_in_mid_drive(tmp_path: Path) -> None:
    """At rest, and the goal ends with a sentence; so does the next one, before anything moves."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin()
        await drive.until_driving()
        await drive.client.delete_map("flat")
        with pytest.raises(GoalFault, match="no map in use"):
            await leg
        await asyncio.sleep(1.0)
        assert drive.speed_m_s < 0.005
        with pytest.raises(CallError, match="no finished map is in use"):
            await drive.begin()

    in_flat(tmp_path, scenario)


def test_a_goal_that_is_sent_while_a_person_drives_begins_when_he_has_let_go(tmp_path: Path) -> None:
    """He turns the robot for 8 s, longer than it may fail to come on: the goal is paused, and then reached."""

    async def scenario(drive: Drive) -> None:
        await drive.client.drive(0.0, 0.3, "teleop")
        leg = drive.begin()
        for _ in range(80):
            await drive.client.drive(0.0, 0.3, "teleop")
            await asyncio.sleep(0.1)
        assert drive.told[-1].state == "paused"
        assert drive.told[-1].reason == "paused, because teleop has control"
        assert "reached" in await leg
        assert not any(event.state == "recovering" for event in drive.told)

    in_flat(tmp_path, scenario)


TWO_LIDARS = [
    {
        "name": name,
        "model": "ld19",
        "device": f"/dev/{name}",
        "mount_x_m": x_m,
        "mount_yaw_rad": yaw_rad,
        "blind_sectors_rad": [[2.0, -2.0]],
    }
    for name, x_m, yaw_rad in (("fore", 0.12, 0.0), ("aft", -0.12, math.pi))
]
"""Each sees 230 degrees, and is blind for the robot behind itself."""


def test_a_robot_with_a_front_and_a_rear_lidar_gets_there_though_one_falls_silent(tmp_path: Path) -> None:
    """The front one, which leads, is silent from the door on: the rear one's scans lead then, at a crawl."""

    async def scenario(drive: Drive) -> None:
        assert len(drive.robot.lidars) == 2
        leg = drive.begin()
        await drive.until_driving()
        drive.robot.lidars["fore"].runner.fault = LidarFault.SILENT
        await asyncio.sleep(1.5)
        speeds_m_s = []
        while not leg.done():
            speeds_m_s.append(drive.speed_m_s)
            await asyncio.sleep(0.1)
        lidars = (await drive.client.get_state()).topics["lidars"].data.lidars
        assert {each.lidar: each.condition for each in lidars} == {"fore": "silent", "aft": "healthy"}
        assert "reached" in await leg
        assert drive.off()[0] < 0.06
        assert 0.05 < max(speeds_m_s) < 0.11

    in_flat(tmp_path, scenario, overrides={"lidar": TWO_LIDARS})


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
