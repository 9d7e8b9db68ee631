"""What those who drive do, or no longer do; and how the robot is told to stop."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from chefbotd.client import CallError, Client
from tests.scenarios.driver import PERIOD_S
from tests.scenarios.fault_run import Fault, FaultRun
from tests.scenarios.faults.outcomes import DEAD_MAN_S, DRIVES_ON, RAMP_S, SLACK_S, estopped, rests

LOWER_SOURCE = {"chefbot": "navigation", "khan": "move_base"}
LOWER_SPEED_M_S = 0.1


@asynccontextmanager
async def silence(fault_run: FaultRun) -> AsyncIterator[None]:
    """The driver says nothing more, but stays connected."""
    fault_run.driver.says = None
    yield


@asynccontextmanager
async def heartbeat(fault_run: FaultRun) -> AsyncIterator[None]:
    """The driver is there and says so, twenty times a second, but drives no more."""
    fault_run.driver.says = Client.ping
    yield


@asynccontextmanager
async def departure(fault_run: FaultRun) -> AsyncIterator[None]:
    """The driver's connection ends."""
    await fault_run.driver.leave()
    yield
    fault_run.driver.come_back()


@asynccontextmanager
async def _lower_source(fault_run: FaultRun) -> AsyncIterator[None]:
    """A program drives too, whom the driver overrules as long as it is heard."""
    source = LOWER_SOURCE[fault_run.robot.client.hello.robot]

    async def navigate(client: Client) -> None:
        while True:
            await client.drive(LOWER_SPEED_M_S, 0.0, source)
            await asyncio.sleep(PERIOD_S)

    async with fault_run.another("navigation") as client:
        navigating = asyncio.create_task(navigate(client))
        await asyncio.sleep(0.5)
        yield
        fault_run.check(not navigating.done(), "the lower source was refused")
        safety = await fault_run.topic("safety")
        fault_run.check(safety["source"] == source, f"followed {safety['source']}")
        off_m_s = abs(fault_run.robot.board.truth(0.0).twist.linear_m_s - LOWER_SPEED_M_S)
        fault_run.check(off_m_s < 0.05 * LOWER_SPEED_M_S, "does not follow the lower source")
        navigating.cancel()
        await asyncio.gather(navigating, return_exceptions=True)


@asynccontextmanager
async def silence_above(fault_run: FaultRun) -> AsyncIterator[None]:
    """The driver says nothing more, and a program that it had overruled still drives."""
    async with _lower_source(fault_run):
        fault_run.driver.says = None
        yield


@asynccontextmanager
async def departure_above(fault_run: FaultRun) -> AsyncIterator[None]:
    """The driver's connection ends, and a program that it had overruled still drives."""
    async with _lower_source(fault_run):
        await fault_run.driver.leave()
        yield
        fault_run.driver.come_back()


@asynccontextmanager
async def second_driver(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody else drives, without asking for control."""
    async with fault_run.another("Bob") as bob:
        try:
            await bob.drive(-0.2, 0.0)
        except CallError as refusal:
            fault_run.check(refusal.kind == "lease_held", f"refused as {refusal.kind}")
            fault_run.check("driver" in str(refusal), f"the holder is not named: {refusal}")
        else:
            fault_run.check(False, "two may drive")
        yield


@asynccontextmanager
async def takeover(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody else takes control and does not drive; the driver goes on commanding, in vain."""
    async with fault_run.another("Bob") as bob:
        await bob.take_control()
        yield
        holders = (await fault_run.topic("safety"))["control"].values()
        fault_run.check(all(str(holder).startswith("Bob") for holder in holders), f"driven by {[*holders]}")
        await bob.release_control()


@asynccontextmanager
async def stop(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody else says stop, and the driver lets it be."""
    fault_run.driver.says = None
    await fault_run.robot.client.stop()
    yield


@asynccontextmanager
async def estop(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody else presses stop in earnest; the driver does not care."""
    await fault_run.robot.client.estop("smoke")
    yield


@asynccontextmanager
async def gains(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody changes the gains of all wheels a little, and then beyond all bounds."""
    client = fault_run.robot.client
    before = await client.get_pid()
    wheel, gain = next(iter(before.items()))
    await client.set_pid(wheel, kp=1.2 * gain.kp)
    try:
        await client.set_pid(wheel, kp=-1.0)
    except CallError as refusal:
        fault_run.check(refusal.kind == "invalid_params", f"refused as {refusal.kind}")
    else:
        fault_run.check(False, "a negative gain was taken")
    yield
    await client.undo_pid()
    fault_run.check(await client.get_pid() == before, "the gains are not as before")


FAULTS = (
    Fault("The driver falls silent", "driver falls silent", silence, rests(DEAD_MAN_S + RAMP_S + SLACK_S)),
    Fault(
        "The driver falls silent",
        "driver falls silent, dead-man 0.1 s",
        silence,
        rests(0.1 + RAMP_S + SLACK_S),
        overrides={"safety.command_timeout_s": 0.1},
    ),
    Fault("The driver falls silent", "driver only pings", heartbeat, rests(DEAD_MAN_S + RAMP_S + SLACK_S)),
    Fault("The highest source falls silent", "driver falls silent, lower source", silence_above, DRIVES_ON),
    Fault("The driver's connection ends", "driver's connection ends", departure, rests(RAMP_S + SLACK_S)),
    Fault(
        "The same, and a lower source is live",
        "driver's connection ends, lower source",
        departure_above,
        DRIVES_ON,
    ),
    Fault("A second driver", "second driver", second_driver, DRIVES_ON),
    Fault("A second driver", "control taken over", takeover, rests(RAMP_S + SLACK_S)),
    Fault("`stop`", "stop", stop, rests(RAMP_S + SLACK_S)),
    Fault("`estop`", "estop", estop, estopped()),
    Fault("Gains changed while driving", "gains changed", gains, DRIVES_ON),
)
