"""What befalls a lidar that guards, and what it guards against."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from functools import partial

from chefbotd.components.simulation.lidar import LidarFault
from tests.scenarios.fault_run import Expected, Fault, FaultRun
from tests.scenarios.faults.outcomes import DRIVES_ON
from tests.scenarios.faults.wheels import OBSTACLE_S, wall

LIDAR = {"name": "lidar", "model": "ld19", "device": "/dev/lidar", "mount_x_m": 0.05, "mount_z_m": 0.2}
WITH_LIDAR = {"lidar": [LIDAR]}
SOUNDS_WRONG = "the link to the lidar is not healthy"
CRAWLS = Expected("armed", "silent:lidar", None, (SOUNDS_WRONG,))


@asynccontextmanager
async def befallen(what: LidarFault, fault_run: FaultRun) -> AsyncIterator[None]:
    """Something is wrong with the lidar; while it lasts no part of the robot is faster than it may be without scans."""
    robot = fault_run.robot
    robot.lidars["lidar"].runner.fault = what
    yield
    if (await fault_run.told())[1] is not None:
        twist = robot.board.truth(0.0).twist
        fault_run.check(abs(twist.linear_m_s) < 0.12, f"drives at {twist.linear_m_s:.2f} m/s without scans")
    robot.lidars["lidar"].runner.fault = None


@asynccontextmanager
async def unplugged(fault_run: FaultRun) -> AsyncIterator[None]:
    """Its cable is pulled."""
    device = fault_run.robot.lidars["lidar"].device
    device.unplug()
    yield
    device.plug()


@asynccontextmanager
async def from_the_start(fault_run: FaultRun) -> AsyncIterator[None]:
    """So it is all the time."""
    yield


_FAULTS = (
    Fault(
        "Lone points of a lidar",
        "lidar in the sun",
        from_the_start,
        DRIVES_ON,
        overrides={"sim.lidar.lone_share": 0.02},
    ),
    Fault(
        "Sensors see obstacles, and the guard is off",
        "guard off",
        from_the_start,
        DRIVES_ON,
        overrides={"safety.guard.enabled": False},
    ),
    Fault("A lidar that guards falls silent", "lidar silent", partial(befallen, LidarFault.SILENT), CRAWLS),
    Fault(
        "A lidar that guards falls silent",
        "lidar unplugged",
        unplugged,
        Expected("armed", "silent:lidar", None, ("link lost",)),
    ),
    *(
        Fault("Bytes of a lidar that are no packets", f"lidar bytes: {what}", partial(befallen, what), CRAWLS)
        for what in (LidarFault.GARBAGE, LidarFault.CUT, LidarFault.WRONG_BAUD)
    ),
    *(
        Fault("A lidar repeats itself", f"lidar {what}", partial(befallen, what), CRAWLS)
        for what in (LidarFault.FROZEN, LidarFault.STALLED)
    ),
    Fault(
        "Bytes of a lidar that come twice",
        "lidar bytes doubled",
        partial(befallen, LidarFault.DOUBLED),
        DRIVES_ON,
    ),
    Fault(
        "Obstacle that a lidar sees",
        "wall behind, seen by a lidar",
        wall,
        Expected("armed", "obstacle:lidar", OBSTACLE_S),
        twist=(-0.2, 0.0),
        leave=(0.2, 0.0),
        lasts_s=6.0,
    ),
)

FAULTS = tuple(replace(fault, overrides={**WITH_LIDAR, **fault.overrides}) for fault in _FAULTS)
