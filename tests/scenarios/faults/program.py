"""What happens inside the program: steps that fail, services that raise or are cancelled, tasks that are lost."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from typing import cast

from chefbotd.client import CallError
from chefbotd.clock import VirtualLoop
from chefbotd.core.events import BatteryCounted, EdgesSeen, EncodersCounted
from tests.scenarios.fault_run import Fault, FaultRun
from tests.scenarios.faults.other_clients import stranger
from tests.scenarios.faults.outcomes import DRIVES_ON, ENDS, drives_on, latched, rests


@asynccontextmanager
async def failing_step(fault_run: FaultRun) -> AsyncIterator[None]:
    """Counts for a wheel that there is not break a control step."""
    now_s = asyncio.get_running_loop().time()
    fault_run.robot.daemon.bus.publish(EncodersCounted(now_s, now_s, now_s, (1, 2, 3, 4, 5)))
    yield


@asynccontextmanager
async def failing_service(times: int, fault_run: FaultRun) -> AsyncIterator[None]:
    """A reading that breaks the sensors' service."""
    for _ in range(times):
        fault_run.robot.daemon.bus.publish(BatteryCounted(0.0, 0.0, "full"))
        await asyncio.sleep(0.005)  # the supervisor starts the service again
    yield


@asynccontextmanager
async def failing_decoder(fault_run: FaultRun) -> AsyncIterator[None]:
    """An edge that is none breaks a part that cannot be missed."""
    fault_run.robot.daemon.bus.publish(EdgesSeen(0.0, 0.0, 0.0, ("edge",)))
    yield


@asynccontextmanager
async def cancelled(task_name: str, fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody cancels one of the daemon's tasks."""
    next(task for task in asyncio.all_tasks() if task.get_name() == task_name).cancel()
    yield


@asynccontextmanager
async def unsaved_map(fault_run: FaultRun) -> AsyncIterator[None]:
    """The folder of maps is where no folder can be, and a client goes on saving a place."""
    async with fault_run.another("mapper") as mapper:
        for _ in range(20):
            try:
                await mapper.save_place("kitchen", 1.5, -0.5, of_map="flat")
            except CallError as refusal:
                fault_run.check(refusal.kind == "storage_failed", f"refused as {refusal.kind}")
            else:
                fault_run.check(False, "saved a place where nothing can be saved")
        yield


FROZEN_S, HELD_UP_S = 1.2, 0.6
DRIVE = b'{"jsonrpc":"2.0","id":1,"method":"drive","params":{"linear_m_s":0.2,"angular_rad_s":0.1}}\n'


@asynccontextmanager
async def frozen_while_driving(seconds: float, fault_run: FaultRun) -> AsyncIterator[None]:
    """The whole program stands still, as on SIGSTOP or on a busy computer; the board drives on meanwhile."""
    cast(VirtualLoop, asyncio.get_running_loop()).stand_still(seconds)
    yield


@asynccontextmanager
async def old_commands(fault_run: FaultRun) -> AsyncIterator[None]:
    """The same at rest, and five commands of a client wait in the kernel meanwhile: all of them are too old."""
    fault_run.driver.says = None
    await asyncio.sleep(1.5)
    async with stranger(fault_run) as (reader, writer):
        await reader.readline()
        await asyncio.sleep(0.1)
        writer.write(5 * DRIVE)
        cast(VirtualLoop, asyncio.get_running_loop()).stand_still(FROZEN_S)
        yield
        answers = [json.loads(await reader.readline()) for _ in range(5)]
        kinds = [answer.get("error", {}).get("data", {}).get("kind") for answer in answers]
        fault_run.check(kinds == ["too_old"] * 5, f"answered with {kinds}")


STEP, SERVICE = "Error in a control step", "A service raises"
LOST = "Six service failures in a minute"

FAULTS = (
    Fault(
        "The program is frozen",
        "frozen for 1.2 s while driving",
        partial(frozen_while_driving, FROZEN_S),
        latched("loop_blocked"),
        on_wire=True,
    ),
    Fault(
        "The control loop is held up",
        "held up for 0.6 s while driving",
        partial(frozen_while_driving, HELD_UP_S),
        drives_on("the control loop stood still while it drove"),
        on_wire=True,
    ),
    Fault(
        "The same while the robot stands",
        "drives sent to a frozen program",
        old_commands,
        rests(0.0),
        on_wire=True,
    ),
    Fault(
        STEP, "control step fails", failing_step, latched("internal_error", logged="a control step failed")
    ),
    Fault(
        SERVICE,
        "service raises",
        partial(failing_service, 1),
        latched("service_failed", logged="a service has failed"),
    ),
    *(
        Fault(
            SERVICE,
            f"service cancelled: {service}",
            partial(cancelled, service),
            latched("service_failed", logged="a service has failed"),
        )
        for service in ("odometry", "sensors", "stats", "fault log")
    ),
    Fault(
        "A map cannot be saved",
        "maps cannot be saved",
        unsaved_map,
        DRIVES_ON,
        overrides={"maps.folder": "/dev/null/maps"},
    ),
    Fault(LOST, "service cannot run", partial(failing_service, 6), ENDS),
    Fault(LOST, "part that cannot be missed raises", failing_decoder, ENDS),
    *(
        Fault(LOST, f"task lost: {task}", partial(cancelled, task), ENDS)
        for task in ("drive", "link", "server", "quadrature")
    ),
)
