"""A request that waits while somebody stops the robot and arms it: it begins nothing until a person decides anew.

It is on the virtual clock, in the simulated flat, and held against the true motion. The robot stands when it is asked.
"""

import asyncio
import math
import tempfile
from collections.abc import Awaitable, Callable, Sequence
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from structlog.testing import capture_logs

from chefbotd.core.geometry import Pose2D
from chefbotd.safety.faults import Fault, FaultKind
from tests.scenarios.fault_run import Result, not_applicable
from tests.scenarios.instruments import FrameCount, StepCount
from tests.scenarios.on_the_way import Drive, in_flat

STOPS_AFTER_S, ARMS_AFTER_S, WATCHED_S = 0.25, 0.37, 12.0
BUSY_S = 2.0
"""The worker reads nothing for so long: what is asked for waits through the stop and the arm."""

STANDS_M, STANDS_RAD = 0.003, 0.01
DRIVES_M = 0.1

Stop = Callable[[Drive], Awaitable[None]]
Decide = Callable[[], Awaitable[None]]
Ask = Callable[[Drive], AbstractAsyncContextManager[Decide | None]]


async def estop(drive: Drive) -> None:
    """Somebody presses the button."""
    await drive.client.estop("a child")


async def fail(drive: Drive) -> None:
    """A fault latches."""
    drive.robot.daemon.driving.fail(Fault(FaultKind.WHEEL_STALLED, "left_wheel is driven and does not turn"))


STOPS: dict[str, Stop] = {"an e-stop": estop, "a fault": fail}


@dataclass(frozen=True, slots=True)
class WaitingFault:
    """Entering ``ask`` asks for a motion that waits; it yields how a person decides anew (None: nobody does).

    ``add_on`` is the distribution without which there is nothing that could wait.
    """

    row: str
    name: str
    ask: Ask
    stop: Stop
    add_on: str = ""
    is_busy: bool = True
    robots: tuple[str, ...] = ("chefbot",)


async def _run(fault: WaitingFault, drive: Drive, wrong: list[str]) -> None:
    if fault.is_busy:
        drive.children[-1].be_busy(BUSY_S)
    async with fault.ask(drive) as decide:
        await asyncio.sleep(STOPS_AFTER_S)
        if _speed(drive) != 0.0:
            wrong.append("moves before it was stopped")
        await fault.stop(drive)
        await asyncio.sleep(ARMS_AFTER_S)
        await drive.client.arm()
        before = drive.truth.world_from_base
        await asyncio.sleep(WATCHED_S)
        wrong += _moved(before, drive.truth.world_from_base)
        if (await drive.client.get_state()).safety.mode != "armed":
            wrong.append("is not armed")
        if decide is not None:
            await decide()
            await asyncio.sleep(WATCHED_S)
            if _way_m(before, drive.truth.world_from_base) < DRIVES_M:
                wrong.append("does not drive when a person decides that it shall")


def _speed(drive: Drive) -> float:
    return max(drive.speed_m_s, abs(float(drive.truth.twist.angular_rad_s)))


def _way_m(before: Pose2D, after: Pose2D) -> float:
    return math.dist((before.x_m, before.y_m), (after.x_m, after.y_m))


def _moved(before: Pose2D, after: Pose2D) -> Sequence[str]:
    turned_rad = abs(math.remainder(after.heading_rad - before.heading_rad, math.tau))
    if (way_m := _way_m(before, after)) > STANDS_M or turned_rad > STANDS_RAD:
        return [f"moved {way_m:.3f} m and {turned_rad:.2f} rad by what was asked before the stop"]
    return []


def attempt(fault: WaitingFault, robot_name: str) -> Result:
    """Let it happen to a fresh robot."""
    if fault.add_on and find_spec(fault.add_on.replace("-", "_")) is None:
        return not_applicable(robot_name, fault.name, f"{fault.add_on} is not installed")
    wrong: list[str] = []

    async def scenario(drive: Drive) -> None:
        frames, steps = FrameCount(drive.robot), StepCount(drive.robot)
        await _run(fault, drive, wrong)
        if frames.lost or steps.missed:
            wrong.append(f"lost {frames.lost} frames, and missed {steps.missed} control steps")

    with capture_logs(), tempfile.TemporaryDirectory(prefix="chefbotd-maps-") as folder:
        in_flat(Path(folder), scenario)
    return Result(robot_name, fault.name, None, None, None, 0, 0, tuple(wrong), outcome="begins nothing")
