"""What happens to a robot that drives to a goal by itself, and how each ends."""

import asyncio
import math
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.simulation.lidar import LidarFault
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.testing.daemon import SimulatedRobot
from tests.scenarios.faults.outcomes import DEAD_MAN_S, RAMP_S, SLACK_S
from tests.scenarios.navigation_run import WayFault
from tests.scenarios.on_the_way import Drive

BRAKED_S = SLACK_S + 2 * RAMP_S
"""From 0.3 m/s, at the follower's 0.6 m/s2 (assumed as the slowest)."""

NO_SCAN_S = 0.6 + BRAKED_S
RADIUS_M, OUTLINE_M = 0.25, 0.18
DOOR_Y_M = 3.25


@asynccontextmanager
async def no_scans(what: LidarFault, drive: Drive) -> AsyncIterator[None]:
    """The lidar says nothing, or the same again and again, until the goal has ended."""
    drive.robot.lidars["lidar"].runner.fault = what
    yield
    drive.robot.lidars["lidar"].runner.fault = None


def turned_round(robot: SimulatedRobot) -> None:
    """The lidar sits the other way round, which its configuration does not say."""
    robot.lidars["lidar"].runner.turn(math.pi)


@asynccontextmanager
async def unknown_to_the_robot(drive: Drive) -> AsyncIterator[None]:
    """It drives by it until it notices; then somebody puts it right, and has the robot look again."""
    begun = drive.truth.world_from_base
    yield
    there = drive.truth.world_from_base
    way_m = math.dist((begun.x_m, begun.y_m), (there.x_m, there.y_m))
    assert way_m < 0.45, f"it drove {way_m:.2f} m without knowing where"
    known = (await drive.client.get_state()).topics["localization"].data
    assert known.state == "lost"
    told = re.search(r"turned by about (-?\d+) degrees against its configured mounting", known.reason)
    assert told is not None
    assert abs(math.remainder(int(told[1]) - 180, 360)) < 10
    drive.robot.lidars["lidar"].runner.turn(math.pi)
    await drive.client.localize()
    await asyncio.sleep(2.0)


@asynccontextmanager
async def worker_killed(drive: Drive) -> AsyncIterator[None]:
    """As by kill -9; the next one is there after half a second."""
    drive.children[-1].kill()
    yield
    assert any("waits until its worker is back" in event.reason for event in drive.told)


@asynccontextmanager
async def another_map(drive: Drive) -> AsyncIterator[None]:
    """The same rooms under another name; afterwards the first one is in use again."""
    store = MapStore(drive.folder, 3)
    await asyncio.to_thread(save, store, "other", FLAT.grid())
    await drive.client.load_map("other")
    yield
    await drive.client.load_map("flat")
    await asyncio.sleep(3.0)


@asynccontextmanager
async def pose_jumps(drive: Drive) -> AsyncIterator[None]:
    """Somebody says that the robot is in another room, and looks another way."""
    here = drive.truth.world_from_base
    await drive.client.set_pose(here.x_m + 3.1, here.y_m - 1.2, here.heading_rad + 2.0)
    yield


@asynccontextmanager
async def person_steps_in(drive: Drive) -> AsyncIterator[None]:
    """From the left into the way at 0.3 m/s, 0.5 m before the outline; she stands there a while, and leaves."""
    here, crowd = drive.truth.world_from_base, drive.robot.board.crowd
    y_m = here.y_m + OUTLINE_M + RADIUS_M + 0.5
    walking = asyncio.create_task(_walk(drive, here.x_m - 0.9, here.x_m, y_m))
    yield
    await walking
    crowd.take_away("somebody")


async def _walk(drive: Drive, from_x_m: float, to_x_m: float, y_m: float) -> None:
    x_m = from_x_m
    while x_m < to_x_m:
        drive.robot.board.crowd.put("somebody", x_m, y_m, RADIUS_M)
        await asyncio.sleep(0.05)
        x_m += 0.3 * 0.05


@asynccontextmanager
async def from_the_beginning(drive: Drive) -> AsyncIterator[None]:
    """Nothing more happens on the way."""
    yield


def scans_late(robot: SimulatedRobot) -> None:
    """Every byte of the lidar is a tenth of a second on its way: so late are all stamps of its scans."""
    device, loop = robot.lidars["lidar"].device, asyncio.get_running_loop()
    feed = device.feed

    def feed_later(data: bytes) -> None:
        loop.call_later(0.1, feed, data)

    device.feed = feed_later  # type: ignore[method-assign]


@asynccontextmanager
async def person_takes_over(drive: Drive) -> AsyncIterator[None]:
    """Somebody backs the robot up by teleop for a second."""
    for _ in range(10):
        await drive.client.drive(-0.05, 0.0, "teleop")
        await asyncio.sleep(0.1)
    assert drive.told[-1].state == "paused"
    assert drive.safety[-1].source == "teleop"
    yield


@asynccontextmanager
async def stopped(drive: Drive) -> AsyncIterator[None]:
    """Somebody sends ``stop``."""
    await drive.client.stop()
    yield


@asynccontextmanager
async def estopped(drive: Drive) -> AsyncIterator[None]:
    """Somebody presses the button."""
    await drive.client.estop("a child")
    yield


@asynccontextmanager
async def driver_leaves(drive: Drive) -> AsyncIterator[None]:
    """The program that waits for the goal gives up."""
    drive.leg.cancel()
    yield


KEEP_OUT = "keep_out:\n  - {name: stairs, corners_m: [[1.8, 3.1], [2.9, 3.1], [2.9, 3.6], [1.8, 3.6]]}\n"
SLIPPERY = {"sim.true.left_slip": 0.15, "sim.true.right_slip": 0.3}

WAY_FAULTS = (
    *(
        WayFault(
            "No scans while",
            f"lidar {what} on the way",
            partial(no_scans, what),
            end="fault",
            reason="no scan arrived",
            rest_s=NO_SCAN_S,
            lasts_s=13.0,
            drives_after=what is LidarFault.SILENT,
            logged=("goal ended",),
        )
        for what in (LidarFault.SILENT, LidarFault.FROZEN)
    ),
    WayFault(
        "A lidar is turned in its mount",
        "lidar turned by 180 degrees",
        unknown_to_the_robot,
        end="fault",
        reason="degrees against its configured mounting",
        lasts_s=3.0,
        before=turned_round,
        drives_after=True,
        logged=("goal ended",),
    ),
    WayFault(
        "The worker is gone or hangs while",
        "worker killed in a doorway",
        worker_killed,
        rest_s=DEAD_MAN_S + BRAKED_S,
        lasts_s=1.0,
        begins_at_y_m=DOOR_Y_M,
        logged=("the worker has ended",),
    ),
    WayFault(
        "Another map is loaded",
        "map swapped on the way",
        another_map,
        end="fault",
        reason="the map was changed from flat to other",
        rest_s=0.3 + BRAKED_S,
        drives_after=True,
        logged=("goal ended",),
    ),
    WayFault("The pose jumps", "pose jumps on the way", pose_jumps, lasts_s=1.0),
    WayFault("Somebody steps in front", "person steps in front", person_steps_in, lasts_s=6.0),
    WayFault("Wheels slip", "carpet on the way", from_the_beginning, overrides=SLIPPERY),
    WayFault(
        "Stairs, glass",
        "stairs in the only door",
        from_the_beginning,
        end="unreachable",
        zones=KEEP_OUT,
        goal={"x_m": 2.3, "y_m": 3.3},
        rest_s=0.0,
        lasts_s=0.1,
        never_drives=True,
    ),
    WayFault("Scans and odometry are", "scans late by 0.1 s", from_the_beginning, before=scans_late),
    WayFault("A person takes over", "teleop on the way", person_takes_over, lasts_s=0.1),
    WayFault(
        "A stop or an e-stop, or a disarmed",
        "stop on the way",
        stopped,
        end="cancelled",
        reason="navigation was stopped by",
        rest_s=BRAKED_S,
        drives_after=True,
        logged=("goal ended",),
    ),
    WayFault(
        "A stop or an e-stop, or a disarmed",
        "e-stop on the way",
        estopped,
        end="fault",
        reason="a child",
        rest_s=BRAKED_S,
        logged=("goal ended",),
    ),
    WayFault(
        "The client that waits for a goal",
        "waiting for the goal given up",
        driver_leaves,
        end="cancelled",
        rest_s=BRAKED_S,
        logged=("goal ended",),
    ),
)
