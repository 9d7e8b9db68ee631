"""Driving to goals in the simulated flat: people and things in the way, and a lidar or a board that falls silent."""

import asyncio
import base64
import math
import zlib
from pathlib import Path

import numpy as np
import pytest

from chefbotd.client import GoalFault
from chefbotd.components.simulation.lidar import LidarFault
from chefbotd.components.simulation.worlds.flat import FLAT
from tests.scenarios.on_the_way import Drive, drives_in_flat, in_flat
from tests.scenarios.robots import AS_CONFIGURED

pytestmark = pytest.mark.slow


@drives_in_flat()
async def test_whoever_looks_sees_the_costs_and_what_is_not_on_the_map(drive: Drive) -> None:
    """A disc of 0.25 m that no map shows: among the obstacles, and blocked in the costs, while the robot stands."""
    here = drive.truth.world_from_base
    x, y = here.x_m, here.y_m + 0.9
    drive.robot.board.crowd.put("somebody", x, y)
    await asyncio.sleep(1.0)
    async with drive.client.subscribe("obstacles") as events:
        async for event in events:
            near = [math.dist((x, y), point) for point in zip(event.data.x_m, event.data.y_m, strict=True)]
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


@drives_in_flat()
async def test_somebody_who_steps_in_front_is_not_touched(drive: Drive) -> None:
    """A disc of 0.25 m appears 0.6 m ahead of the outline in the door; when it leaves, the goal is reached."""
    leg = drive.begin()
    await drive.until_driving()
    here = drive.truth.world_from_base
    drive.robot.board.crowd.put("somebody", here.x_m, here.y_m + 0.18 + 0.25 + 0.6)
    await asyncio.sleep(8.0)
    assert not drive.truth.in_contact
    assert not leg.done()
    drive.robot.board.crowd.take_away("somebody")
    assert "reached" in await leg


@pytest.mark.parametrize("late_s", [0.0, 0.0125, 0.025, 0.0375])
@pytest.mark.parametrize(
    ("from_x_m", "speed_m_s", "apart_m"),
    [(0.9, 0.3, 0.02), (0.3, 0.5, 0.0), (4.3, -0.3, 0.02), (6.0, -0.8, 0.02)],
)
def test_somebody_who_walks_across_is_not_touched(
    tmp_path: Path, from_x_m: float, speed_m_s: float, apart_m: float, late_s: float
) -> None:
    """A disc of 0.25 m crosses the way in the hall and waits for nobody; the goal is reached behind it.

    So at each phase of the worker's steps to the lidar's turns, and though the board is silent for a second meanwhile.
    """

    async def scenario(drive: Drive) -> None:
        leg, crowd = drive.begin(), drive.robot.board.crowd
        await drive.until_driving()
        least_m = math.inf
        for step in range(200):
            x, y = from_x_m + speed_m_s * 0.05 * step, 3.95
            crowd.put("somebody", x, y)
            await asyncio.sleep(0.05)
            pose = drive.truth.world_from_base
            least_m = min(least_m, math.dist((pose.x_m, pose.y_m), (x, y)) - 0.25 - 0.18)
            assert not drive.truth.in_contact
        crowd.take_away("somebody")
        assert least_m > apart_m
        assert "reached" in await leg

    in_flat(tmp_path, scenario, worker_late_s=late_s)


@pytest.mark.parametrize("fault", [LidarFault.SILENT, LidarFault.FROZEN])
@drives_in_flat()
async def test_without_scans_the_robot_stands_and_the_goal_ends(drive: Drive, fault: LidarFault) -> None:
    """The lidar falls silent or repeats itself in mid-drive: at rest within 2 s, a fault after 10 s more."""
    leg = drive.begin()
    await drive.until_driving()
    drive.robot.lidars["lidar"].runner.fault = fault
    await asyncio.sleep(2.0)
    assert drive.speed_m_s < 0.005
    with pytest.raises(GoalFault, match="no scan arrived"):
        await leg


@drives_in_flat()
async def test_a_lidar_that_is_off_for_a_while_makes_it_wait(drive: Drive) -> None:
    """Four seconds: it stands, and then the goal is reached; meanwhile nobody is told that it is localized."""
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


@drives_in_flat()
async def test_a_board_that_is_silent_for_a_second_loses_nobody(drive: Drive) -> None:
    """An echo that is missing silences the classic board: the gate brakes, and the goal goes on without being lost."""
    leg = drive.begin()
    await drive.until_driving()
    feed, drive.robot.device.feed = drive.robot.device.feed, lambda data: None  # type: ignore[method-assign]
    await asyncio.sleep(1.0)
    drive.robot.device.feed = feed  # type: ignore[method-assign]
    assert "reached" in await leg
    assert not any("does not know where it is" in event.reason for event in drive.told)


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


@drives_in_flat(overrides={"lidar": TWO_LIDARS, **AS_CONFIGURED})
async def test_a_robot_with_a_front_and_a_rear_lidar_gets_there_though_one_falls_silent(drive: Drive) -> None:
    """The front one, which leads, is silent from the door on: the rear one's scans lead then, at a crawl."""
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
