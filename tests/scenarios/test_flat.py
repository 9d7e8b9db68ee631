"""The daemon with a lidar in the flat: what it sees, from where it truly is, and what goes wrong with lidars."""

import asyncio
import math
from collections.abc import Awaitable, Callable
from pathlib import Path

import numpy as np
import pytest

from chefbotd.clock import run_virtual
from chefbotd.components.simulation.lidar import LidarFault
from chefbotd.components.simulation.rooms import scene_of
from chefbotd.components.simulation.world import World
from chefbotd.core.events.lidars import LidarChanged, ScanMeasured
from chefbotd.perception.laser_scan import OdometryTrack, points_in_base
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import sample

WALLS = World(scene_of(Path("flat")).slice(0.2)[0])


def in_flat(scenario: Callable[[SimulatedRobot], Awaitable[None]], **overrides: object) -> None:
    """Run a scenario on ChefBot with its lidar, armed, in the flat."""

    async def run() -> None:
        async with simulated_robot(load(packaged("chefbot_lidar"), overrides=overrides)) as robot:
            await asyncio.sleep(2.0)
            await scenario(robot)

    run_virtual(run())


async def trail_of(robot: SimulatedRobot, seconds: float) -> OdometryTrack:
    """Where the robot truly is, every 10 ms."""
    rows = []
    for _ in range(round(seconds / 0.01)):
        await asyncio.sleep(0.01)
        now_s = asyncio.get_running_loop().time()
        pose = robot.board.truth(now_s).world_from_base
        rows.append((now_s, pose.x_m, pose.y_m, pose.heading_rad))
    times = np.array(rows)
    return OdometryTrack(times[:, 0], times[:, 1:])


def to_walls_m(points: np.ndarray) -> np.ndarray:
    """How far each point is from the nearest surface."""
    return np.array([WALLS.clearance_m((x, y)) for x, y in points])


@pytest.mark.slow
def test_scans_of_a_robot_that_turns_and_drives_lie_on_the_walls() -> None:
    """With the true poses under the beams' own times: half of the points within 1.5 cm, nearly all within 5 cm."""
    seen: list[ScanMeasured] = []

    async def scenario(robot: SimulatedRobot) -> None:
        robot.daemon.bus.add_handler(seen.append, ScanMeasured)
        async with asyncio.TaskGroup() as group:
            driving = group.create_task(robot.client.drive_for(2.5, 0.15, 0.7))
            truth = await trail_of(robot, 3.0)
            await driving
        assert 27 <= len(seen) <= 31
        beams = (0.05, 12.0)
        off_m = []
        for scan in seen[2:-2]:
            assert scan.base_from_lidar.x_m == 0.05
            in_base = points_in_base(beams, scan.base_from_lidar, scan.scan, truth)
            k = int(np.abs(truth.stamp_s - scan.scan.stamp_s).argmin())
            x, y, heading = truth.odom_from_base[k]
            cos, sin = math.cos(heading), math.sin(heading)
            off_m.append(to_walls_m(in_base @ np.array([[cos, sin], [-sin, cos]]) + [x, y]))
        assert np.median(np.concatenate(off_m)) < 0.015
        assert np.quantile(np.concatenate(off_m), 0.97) < 0.05
        assert all(len(each) > 350 for each in off_m)

    in_flat(scenario)


@pytest.mark.slow
def test_the_same_seed_sees_the_same() -> None:
    """Two runs, bit for bit; another seed, other noise."""
    runs = []
    for seed in (3, 3, 4):
        seen: list[ScanMeasured] = []

        async def scenario(robot: SimulatedRobot, seen: list[ScanMeasured] = seen) -> None:
            robot.daemon.bus.add_handler(seen.append, ScanMeasured)
            await robot.client.drive_for(1.0, 0.1, -0.4)

        in_flat(scenario, **{"sim.seed": seed})
        runs.append(np.concatenate([scan.scan.range_m for scan in seen]))
    assert (runs[0] == runs[1]).all()
    assert runs[0].shape != runs[2].shape or not (runs[0] == runs[2]).all()


@pytest.mark.slow
def test_a_thing_that_is_put_in_the_way_is_seen_and_bumped_into() -> None:
    """A bag 0.7 m ahead: the scan ends at it; with the guard off the robot touches it, which the truth tells."""

    async def scenario(robot: SimulatedRobot) -> None:
        seen: list[ScanMeasured] = []
        robot.daemon.bus.add_handler(seen.append, ScanMeasured)
        pose = robot.board.truth(0.0).world_from_base
        x, y = pose.x_m + 0.7 * math.cos(pose.heading_rad), pose.y_m + 0.7 * math.sin(pose.heading_rad)
        robot.board.crowd.put("bag", x, y, 0.15)
        await asyncio.sleep(0.5)
        scan = seen[-1].scan
        ahead = np.abs((scan.bearing_rad + math.pi) % math.tau - math.pi) < 0.05
        assert np.median(scan.range_m[ahead]) == pytest.approx(0.7 - 0.15 - 0.05, abs=0.02)
        assert not robot.board.truth(0.0).in_contact
        await robot.client.drive_for(3.0, 0.2)
        touching = robot.board.truth(0.0)
        assert touching.in_contact
        gap_m = math.dist((touching.world_from_base.x_m, touching.world_from_base.y_m), (x, y))
        assert gap_m == pytest.approx(0.15 + 0.18, abs=0.001)

    in_flat(scenario, **{"safety.guard.enabled": False})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "condition"),
    sample(
        [
            (LidarFault.FROZEN, "frozen"),
            (LidarFault.SILENT, "silent"),
            (LidarFault.GARBAGE, "wrong_baud"),
            (LidarFault.WRONG_BAUD, "wrong_baud"),
            (LidarFault.STALLED, "motor_stalled"),
        ]
    ),
)
def test_what_is_wrong_with_the_lidar_is_told_and_mended(fault: LidarFault, condition: str) -> None:
    """Ten seconds of the fault: no scan in the last of them, the condition is told; then it is healthy again."""

    async def scenario(robot: SimulatedRobot) -> None:
        told: list[str] = []
        seen: list[float] = []
        robot.daemon.bus.add_handler(lambda event: told.append(event.condition), LidarChanged)
        robot.daemon.bus.add_handler(lambda event: seen.append(event.stamp_s), ScanMeasured)
        runner = robot.lidars["lidar"].runner
        runner.fault = fault
        await asyncio.sleep(10.0)
        assert condition in told
        assert not [stamp_s for stamp_s in seen if stamp_s > asyncio.get_running_loop().time() - 5]
        runner.fault = None
        await asyncio.sleep(5.0)
        assert told[-1] == "healthy"
        assert len([stamp_s for stamp_s in seen if stamp_s > asyncio.get_running_loop().time() - 1]) >= 9

    in_flat(scenario)


@pytest.mark.parametrize("fault", sample([LidarFault.CUT, LidarFault.DOUBLED]))
def test_cut_and_doubled_packets_make_no_false_wall(fault: LidarFault) -> None:
    """What still comes out of it lies on the walls."""

    async def scenario(robot: SimulatedRobot) -> None:
        robot.lidars["lidar"].runner.fault = fault
        seen: list[ScanMeasured] = []
        robot.daemon.bus.add_handler(seen.append, ScanMeasured)
        await asyncio.sleep(3.0)
        pose = robot.board.truth(0.0).world_from_base
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        standing = OdometryTrack(np.zeros(1), np.zeros((1, 3)))
        for scan in seen:
            points = points_in_base((0.05, 30.0), scan.base_from_lidar, scan.scan, standing)
            off_m = to_walls_m(points @ np.array([[cos, sin], [-sin, cos]]) + [pose.x_m, pose.y_m])
            assert np.quantile(off_m, 0.95) < 0.05

    in_flat(scenario)


def test_a_lidar_that_is_unplugged_comes_back_by_itself() -> None:
    """Its cable out for 3 s: down, then healthy, and scans again."""

    async def scenario(robot: SimulatedRobot) -> None:
        told: list[str] = []
        robot.daemon.bus.add_handler(lambda event: told.append(event.condition), LidarChanged)
        cable = robot.lidars["lidar"].device
        cable.unplug()
        await asyncio.sleep(3.0)
        cable.plug()
        await asyncio.sleep(6.0)
        assert told[0] == "down"
        assert told[-1] == "healthy"

    in_flat(scenario)
