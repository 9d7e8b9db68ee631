"""A hall with nothing in reach of the ultrasonic sensor: the classic board is silent for a second in every cycle."""

import asyncio
import math
from pathlib import Path

import numpy as np
import pytest

from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from tests.scenarios.on_the_way import Drive, in_flat
from tests.scenarios.robots import AS_CONFIGURED

pytestmark = pytest.mark.slow

CELL_M = 0.05
START = {"sim.world.start_x_m": 5.0, "sim.world.start_y_m": 6.0, "sim.world.start_heading_rad": 0.0}


def hall() -> OccupancyGrid:
    """12 by 12 m, with a stage, a counter and a pillar at its walls, which tell the directions apart."""
    cells = round(12 / CELL_M)
    percent = np.full((cells + 2, cells + 2), FREE, np.int8)
    percent[0] = percent[-1] = percent[:, 0] = percent[:, -1] = OCCUPIED
    for x_m, y_m, width_m, depth_m in ((0, 0, 1.5, 1.0), (11.4, 9.5, 0.6, 2.5), (3.0, 11.6, 1.5, 0.4)):
        row, column = round(y_m / CELL_M) + 1, round(x_m / CELL_M) + 1
        percent[row : row + round(depth_m / CELL_M), column : column + round(width_m / CELL_M)] = OCCUPIED
    return OccupancyGrid(CELL_M, Pose2D(-CELL_M, -CELL_M), percent)


async def crawling(drive: Drive) -> None:
    """Until the robot is on its way."""
    async with asyncio.timeout(20.0):
        while drive.speed_m_s < 0.03:  # noqa: ASYNC110 - the truth has no event
            await asyncio.sleep(0.05)


@pytest.mark.parametrize("goal", [(5.5, 6.1, 0.6), (4.8, 6.0, 0.2)])
def test_the_robot_crawls_and_arrives(tmp_path: Path, goal: tuple[float, float, float]) -> None:
    """Ahead and behind: within 4 cm and 3 degrees, no rim faster than 0.1 m/s, and no fault."""

    async def scenario(drive: Drive) -> None:
        x_m, y_m, heading_rad = goal
        fastest_m_s = 0.0
        leg = drive.begin(x_m=x_m, y_m=y_m, heading_rad=heading_rad)
        while not leg.done():
            await asyncio.sleep(0.1)
            twist = drive.truth.twist
            fastest_m_s = max(fastest_m_s, abs(twist.linear_m_s) + 0.15 * abs(twist.angular_rad_s))
        assert "reached" in await leg
        pose = drive.truth.world_from_base
        assert math.dist((pose.x_m, pose.y_m), (x_m, y_m)) < 0.04
        assert abs(math.remainder(pose.heading_rad - heading_rad, math.tau)) < math.radians(3)
        assert 0.03 < fastest_m_s < 0.1
        assert {event.mode for event in drive.safety} == {"armed"}

    in_flat(tmp_path, scenario, overrides={**START, **AS_CONFIGURED}, grid=hall())


def test_what_stands_in_the_way_of_a_crawling_robot_is_not_touched(tmp_path: Path) -> None:
    """A disc of 0.25 m, 0.4 m ahead of its outline: the robot stops, or turns away."""

    async def scenario(drive: Drive) -> None:
        leg = drive.begin(x_m=5.6, y_m=6.0, heading_rad=0.0)
        await crawling(drive)
        pose = drive.truth.world_from_base
        drive.robot.board.crowd.put("somebody", pose.x_m + 0.18 + 0.25 + 0.4, pose.y_m)
        for _ in range(60):
            await asyncio.sleep(0.1)
            assert not drive.truth.in_contact
        drive.robot.board.crowd.take_away("somebody")
        assert not leg.done()
        leg.cancel()

    in_flat(tmp_path, scenario, overrides=START, grid=hall())


@pytest.mark.parametrize("how", ["estop", "stop", "silence"])
def test_a_crawling_robot_stands_after_two_cycles(tmp_path: Path, how: str) -> None:
    """An e-stop, a stop, a driver that is gone: the board obeys within 2.1 s, and 0.5 s more of the dead-man.

    At 0.06 m/s, and a third more while the wheel loop settles, it goes no farther than 0.15 m and 0.19 m meanwhile.
    """

    async def scenario(drive: Drive) -> None:
        async def keep_driving() -> None:
            while True:
                await drive.client.drive(0.3, 0.0, "teleop")
                await asyncio.sleep(0.1)

        driving = asyncio.create_task(keep_driving())
        await crawling(drive)
        await asyncio.sleep(1.3)
        driving.cancel()
        began = drive.truth.world_from_base
        if how != "silence":
            await (drive.client.estop("test") if how == "estop" else drive.client.stop())
        late_s = 0.5 if how == "silence" else 0.0
        await asyncio.sleep(2.1 + 0.2 + late_s)
        pose = drive.truth.world_from_base
        assert drive.speed_m_s < 0.005
        assert math.dist((pose.x_m, pose.y_m), (began.x_m, began.y_m)) < (0.19 if late_s else 0.15)

    in_flat(tmp_path, scenario, overrides=START, grid=hall())
