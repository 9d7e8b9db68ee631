"""Two simulated robots on one floor, each with its own daemon: they see each other by lidar alone."""

import asyncio
import math
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from chefbotd.client import GoalNotReached
from chefbotd.clock import run_virtual
from chefbotd.core.geometry import Pose2D
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from chefbotd.testing.on_map import localized_robot

BODIES_M = 2 * 0.18
LONGEST_S = 240.0


async def _watch(robots: list[SimulatedRobot], apart_m: list[float], touches: list[bool]) -> None:
    """The distance between the two bodies, and whether either touches anything, from the truth at every step."""
    while True:
        truths = [robot.board.truth(robot.now_s()) for robot in robots]
        one, other = (truth.world_from_base for truth in truths)
        apart_m.append(math.hypot(one.x_m - other.x_m, one.y_m - other.y_m))
        touches.append(any(truth.in_contact for truth in truths))
        await asyncio.sleep(0.01)


async def _drive(robot: SimulatedRobot, goal: Pose2D) -> str:
    try:
        return await robot.client.navigate_to(goal.x_m, goal.y_m)
    except GoalNotReached as ended:
        return str(ended)


async def _cross(folder: Path, ways: tuple[tuple[Pose2D, Pose2D], ...]) -> tuple[list[str], float, bool]:
    """Both drive at once; how each ended, how near they came, and whether anything touched."""
    apart_m: list[float] = []
    touches: list[bool] = []
    async with AsyncExitStack() as stack:
        robots = []
        for number, (start, _) in enumerate(ways):
            own = {
                "robot.name": f"r{number}",
                "sim.seed": number,
                "sim.world.shared_truth": str(folder / f"r{number}.truth"),
                "sim.board.sketch": "chefbot",
                "encoders.counted_by": "firmware",
            }
            robots.append(await stack.enter_async_context(localized_robot("flat", start, overrides=own)))
        watching = asyncio.create_task(_watch(robots, apart_m, touches))
        async with asyncio.timeout(LONGEST_S):
            ends = await asyncio.gather(
                *[_drive(robot, goal) for robot, (_, goal) in zip(robots, ways, strict=True)]
            )
        watching.cancel()
    return list(ends), min(apart_m), any(touches)


@pytest.mark.slow
def test_two_robots_that_meet_head_on_pass_without_a_touch(tmp_path: Path) -> None:
    """Each drives to where the other began; nobody coordinates them, and both arrive."""
    one, other = Pose2D(3.0, 4.0, 0.0), Pose2D(8.0, 4.0, math.pi)
    ends, nearest_m, touched = run_virtual(_cross(tmp_path, ((one, other), (other, one))))
    assert not touched
    assert nearest_m > BODIES_M
    assert all("reached" in end for end in ends), ends


async def _drive_at_each_other(folder: Path, speeds_m_s: tuple[float, float]) -> tuple[float, bool]:
    """Both face the same way in the office's corridor, 2 m apart, and are driven for 10 s."""
    apart_m: list[float] = []
    touches: list[bool] = []
    async with AsyncExitStack() as stack:
        robots = []
        for number, x_m in enumerate((7.5, 9.5)):
            own = {
                "robot.name": f"r{number}",
                "sim.seed": number,
                "sim.world.map_path": "office",
                "sim.world.start_x_m": x_m,
                "sim.world.start_y_m": 4.4,
                "sim.world.start_heading_rad": 0.0,
                "sim.world.shared_truth": str(folder / f"r{number}.truth"),
            }
            settings = load(packaged("chefbot_lidar"), overrides=own)
            robots.append(await stack.enter_async_context(simulated_robot(settings)))
        await asyncio.sleep(2.5)
        watching = asyncio.create_task(_watch(robots, apart_m, touches))
        for _ in range(200):
            for robot, speed_m_s in zip(robots, speeds_m_s, strict=True):
                await robot.client.drive(speed_m_s, 0.0)
            await asyncio.sleep(0.05)
        watching.cancel()
    return min(apart_m), any(touches)


@pytest.mark.parametrize(
    "speeds_m_s",
    [(0.2, -0.4), *[pytest.param(pair, marks=pytest.mark.slow) for pair in ((0.3, -0.3), (0.5, -0.2))]],
)
def test_robots_that_are_driven_at_each_other_stand_apart(
    tmp_path: Path, speeds_m_s: tuple[float, float]
) -> None:
    """One of them backwards, where it has no ultrasonic sensor: they leave the 5 cm that each leaves before a wall."""
    nearest_m, touched = run_virtual(_drive_at_each_other(tmp_path, speeds_m_s))
    assert not touched
    assert nearest_m > BODIES_M + 0.05
