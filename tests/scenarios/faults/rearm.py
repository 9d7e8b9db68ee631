"""With ``rearm = "auto"``: what has passed is left without anybody's doing, and what needs a person is not."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

from chefbotd.core.events import SafetyChanged
from tests.scenarios.fault_run import Fault, FaultRun
from tests.scenarios.faults.board import reset
from tests.scenarios.faults.link import REPLUG_S, unplugged
from tests.scenarios.faults.outcomes import AT_ONCE_S, DRIVES_ON, NO_BATTERY, SLACK_S, estopped, latched
from tests.scenarios.faults.program import failing_step
from tests.scenarios.faults.wheels import broken_encoder, critical_battery
from tests.scenarios.robots import CYCLE_S
from tests.scenarios.wires import frozen

AUTO = {"safety.rearm": "auto"}
ROW = '`safety.rearm = "auto"`'


@asynccontextmanager
async def told_and_left(fault_run: FaultRun) -> AsyncIterator[None]:
    """The cable is pulled for a second: it latches as ever before it is left."""
    changes = fault_run.robot.daemon.bus.subscribe(SafetyChanged, size=64)
    async with unplugged(fault_run):
        yield
    told = [changes.take_event().fault for _ in range(len(changes))]
    changes.close()
    fault_run.check("link_lost" in told, f"told as {told}")


@asynccontextmanager
async def counted_and_left(fault_run: FaultRun) -> AsyncIterator[None]:
    """The board restarts: it is counted, and left in the same moment."""
    before = fault_run.robot.daemon.session.restarts.memory.count
    async with reset(fault_run):
        yield
    fault_run.check(
        fault_run.robot.daemon.session.restarts.memory.count == before + 1, "the restart was not noticed"
    )


@asynccontextmanager
async def estop_then_replug(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody presses stop in earnest and goes; then the cable is pulled and put back, and the board restarts."""
    async with fault_run.another("Eve") as eve:
        await eve.estop("smoke")
    async with unplugged(fault_run):
        await asyncio.sleep(REPLUG_S + 2.0)
        await fault_run.robot.client.reset_board()
        await asyncio.sleep(2.0)
        fault_run.check(not any(fault_run.robot.board.duty), "moves again")
        yield


FAULTS = (
    Fault(
        ROW,
        "cable pulled for 1 s, rearm auto",
        told_and_left,
        DRIVES_ON,
        lasts_s=5.0,
        on_wire=True,
        overrides=AUTO,
    ),
    Fault(
        ROW,
        "board restarts, rearm auto",
        counted_and_left,
        DRIVES_ON,
        lasts_s=5.0,
        overrides=AUTO,
        sketches={"duemilanove": "its sketch does not restart when it is asked to"},
    ),
    Fault(
        "Wheel blocked",
        "encoder unplugged, rearm auto",
        broken_encoder(partial(frozen, 0)),
        latched("wheel_stalled", 2.2),
        on_wire=True,
        overrides=AUTO,
    ),
    Fault(
        "Battery critical",
        "battery critical, rearm auto",
        critical_battery,
        latched("battery_critical", 5.0 + 2 * CYCLE_S + SLACK_S),
        lasts_s=7.0,
        on_wire=True,
        overrides=AUTO,
        sketches=NO_BATTERY,
    ),
    Fault(
        "Error in a control step",
        "control step fails, rearm auto",
        failing_step,
        latched("internal_error"),
        overrides=AUTO,
    ),
    Fault(
        "`estop`",
        "estop, its client gone, cable and board back",
        estop_then_replug,
        estopped(AT_ONCE_S),
        on_wire=True,
        overrides=AUTO,
    ),
)
