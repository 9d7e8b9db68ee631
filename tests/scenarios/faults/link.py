"""What happens to the link, and what comes over the wire."""

import asyncio
import random
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

from chefbotd.client import Client
from chefbotd.core.events import LinkClosed, LinkOpened
from chefbotd.safety.encoder_timeout import OVERSHOOT
from tests.scenarios.fault_run import Expected, Fault, FaultRun
from tests.scenarios.faults.outcomes import (
    BOARD_DEAD_MAN_S,
    NO_WAIT,
    ONCE_A_CYCLE_S,
    SLACK_S,
    STALE,
    STALE_S,
    drives_on,
    estopped,
    latched,
    rests,
)
from tests.scenarios.instruments import task_count
from tests.scenarios.robots import ROBOTS
from tests.scenarios.wires import DISARMING, damage, misread, transport_of

MISSING_M = 0.03
"""0.2 m/s, a few readings of 20 ms, and as many that have to agree with an unlikely one."""

REPLUG_S = 1.0
LONGEST_BACKOFF_S = 2.0
REPLUGS = 100
BACKOFF_OPENS = 8
"""In three seconds: after 0.1, 0.2, 0.4, 0.8 and then every 2 s, each varied by a fifth."""

CRAWLS_S, CRAWLS_M_S = 8.0, 0.06 * OVERSHOOT
"""After so long among silences it crawls: the wheel loop, which has one reading in each, takes its time."""

GPS = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"
NOT_THE_BOARD = "the link to the board is not healthy"
TWICE_JUDGED_S = 5.0
"""What comes in is judged every 2 s: the first time by what came before the fault, too."""


@asynccontextmanager
async def unheard(fault_run: FaultRun) -> AsyncIterator[None]:
    """Nothing that the board says arrives."""
    transport = transport_of(fault_run.robot)
    feed, transport.feed = transport.feed, lambda data: None
    yield
    transport.feed = feed


@asynccontextmanager
async def without_echoes(fault_run: FaultRun) -> AsyncIterator[None]:
    """Nothing is in reach of the ultrasonic sensor: the sketch waits for it in every cycle, and the robot crawls."""
    board = fault_run.robot.board
    board.lose_echoes(True)
    await asyncio.sleep(CRAWLS_S)
    speed_m_s = board.truth(0.0).twist.linear_m_s
    fault_run.check(0.03 < speed_m_s < CRAWLS_M_S, f"crawls at {speed_m_s:.3f} m/s")
    yield
    board.lose_echoes(False)
    await asyncio.sleep(ONCE_A_CYCLE_S)


@asynccontextmanager
async def stopped_without_echoes(fault_run: FaultRun) -> AsyncIterator[None]:
    """The same, and the driver asks it to stop."""
    async with without_echoes(fault_run):
        fault_run.driver.says = Client.stop
        yield


@asynccontextmanager
async def estopped_without_echoes(fault_run: FaultRun) -> AsyncIterator[None]:
    """The same, and somebody presses the emergency stop."""
    async with without_echoes(fault_run):
        await fault_run.robot.client.estop("a child")
        yield


@asynccontextmanager
async def heard_as(condition: str, fault_run: FaultRun) -> AsyncIterator[None]:
    """At the end of this context the link's topic says what the port sounds like."""
    yield
    told = await fault_run.topic("link")
    fault_run.check(
        (told["condition"], told["healthy"]) == (condition, False), f"heard as {told['condition']}"
    )


@asynccontextmanager
async def silent(fault_run: FaultRun) -> AsyncIterator[None]:
    """The board says nothing for so long that the port is told to be silent."""
    async with unheard(fault_run), heard_as("silent", fault_run):
        yield


@asynccontextmanager
async def _instead(said: bytes, period_s: float, fault_run: FaultRun) -> AsyncIterator[None]:
    """This comes in, again and again, and nothing of the board's."""
    transport = transport_of(fault_run.robot)
    feed = transport.feed

    async def talk() -> None:
        while True:
            feed(said)
            await asyncio.sleep(period_s)

    async with unheard(fault_run):
        talking = asyncio.create_task(talk())
        yield
        talking.cancel()


@asynccontextmanager
async def other_device(fault_run: FaultRun) -> AsyncIterator[None]:
    """What comes in is a satellite receiver's."""
    async with _instead(GPS, 0.1, fault_run), heard_as("wrong_device", fault_run):
        yield


@asynccontextmanager
async def noise(fault_run: FaultRun) -> AsyncIterator[None]:
    """A megabyte a second, and nothing else."""
    async with _instead(random.Random(3).randbytes(10_000), 0.01, fault_run):
        yield


@asynccontextmanager
async def wrong_baud(board_baud: int, fault_run: FaultRun) -> AsyncIterator[None]:
    """The board's program talks at another rate than the port's 115200."""
    transport = transport_of(fault_run.robot)
    feed = transport.feed
    transport.feed = lambda data: feed(misread(data, board_baud / 115_200))
    async with heard_as("wrong_baud", fault_run):
        yield
    transport.feed = feed


@asynccontextmanager
async def damaged(share: str, fault_run: FaultRun) -> AsyncIterator[None]:
    """One byte in a hundred suffers, both ways."""
    transport, device = transport_of(fault_run.robot), fault_run.robot.device
    feed, write = transport.feed, device.on_write
    damage(fault_run.robot, {share: 0.01}, seed=7)
    yield
    transport.feed, device.on_write = feed, write


@asynccontextmanager
async def misheard(share: str, fault_run: FaultRun) -> AsyncIterator[None]:
    """The same, but only what the board says: odometry loses no more than the readings that are still missing.

    Unless it disarms: then a damaged reading was believed.
    """
    write, off_m = fault_run.robot.device.on_write, await fault_run.odometry_error_m()
    async with damaged(share, fault_run):
        fault_run.robot.device.on_write = write
        yield
        worse_m = await fault_run.odometry_error_m() - off_m
        mode, _ = await fault_run.told()
        fault_run.check(mode != "armed" or worse_m < MISSING_M, f"odometry is {worse_m:.3f} m worse")


@asynccontextmanager
async def unplugged(fault_run: FaultRun) -> AsyncIterator[None]:
    """The cable is pulled, and put back a second later."""
    device = fault_run.robot.device
    device.unplug()
    asyncio.get_running_loop().call_later(REPLUG_S, device.plug)
    yield


@asynccontextmanager
async def replugged(fault_run: FaultRun) -> AsyncIterator[None]:
    """The cable is pulled and put back a hundred times: no task is left over."""
    device, daemon = fault_run.robot.device, fault_run.robot.daemon
    events = daemon.bus.subscribe(LinkOpened, LinkClosed, size=2 * REPLUGS)
    before = task_count()
    for _ in range(REPLUGS):
        device.unplug()
        await events.get()
        device.plug()
        await events.get()
        await asyncio.sleep(SLACK_S)
    events.close()
    left = task_count() - before
    fault_run.check(not left, f"{left} tasks more than before")
    yield


@asynccontextmanager
async def opens_and_closes(fault_run: FaultRun) -> AsyncIterator[None]:
    """The port is lost as soon as it is open, for three seconds: it is tried ever more rarely."""
    robot = fault_run.robot
    opened, before = robot.daemon.bus.subscribe(LinkOpened), robot.daemon.session.memory.opens

    async def close_again() -> None:
        transport_of(robot).lose(OSError("gone again"))
        async for _ in opened:
            transport_of(robot).lose(OSError("gone again"))

    closing = asyncio.create_task(close_again())
    yield
    closing.cancel()
    opened.close()
    opens = robot.daemon.session.memory.opens - before
    fault_run.check(1 < opens <= BACKOFF_OPENS, f"opened {opens} times")
    await asyncio.sleep(LONGEST_BACKOFF_S * 1.2)


PULLED_S = REPLUG_S + LONGEST_BACKOFF_S + SLACK_S

FAULTS = (
    Fault("Encoders silent for a moment", "board silent for 1 s", unheard, STALE, lasts_s=1.0, on_wire=True),
    *(
        Fault(
            "Encoders silent in every cycle",
            f"no echo in any cycle{and_then}",
            inject,
            expected,
            lasts_s=4.0,
            robots=("chefbot",),
            sketches=NO_WAIT,
        )
        for and_then, inject, expected in (
            ("", without_echoes, Expected("armed", "no_echo")),
            (", stop", stopped_without_echoes, rests(ONCE_A_CYCLE_S + SLACK_S)),
            (", estop", estopped_without_echoes, estopped(ONCE_A_CYCLE_S + SLACK_S)),
        )
    ),
    Fault(
        "Encoders silent for longer",
        "board silent for longer",
        silent,
        latched("encoders_silent", STALE_S, NOT_THE_BOARD),
        lasts_s=TWICE_JUDGED_S,
        on_wire=True,
    ),
    Fault(
        "Nothing on the port, or another device",
        "another device talks",
        other_device,
        latched("encoders_silent", STALE_S, NOT_THE_BOARD),
        lasts_s=TWICE_JUDGED_S,
        on_wire=True,
    ),
    *(
        Fault(
            "Wrong baud rate",
            f"board talks at {baud} baud",
            partial(wrong_baud, baud),
            latched("encoders_silent", STALE_S, NOT_THE_BOARD),
            lasts_s=TWICE_JUDGED_S,
            on_wire=True,
        )
        for baud in (9600, 57_600, 230_400)
    ),
    Fault(
        "Wrong baud rate",
        "noise at 1 MB/s for 1 s",
        noise,
        Expected("armed", "encoders_stale", STALE_S, ("line refused",)),
        lasts_s=1.0,
        on_wire=True,
    ),
    *(
        Fault(
            "1 % of all bytes",
            f"1 % of bytes {way}: {share}",
            partial(inject, f"{share}_share"),
            drives_on("line refused"),
            on_wire=True,
            by_chance=by_chance[share],
            # A reading of KHAN's infrared with a digit lost or doubled claims an obstacle now and then: there it brakes.
            robots=ROBOTS if share == "flip" else ("chefbot",),
        )
        for way, inject, by_chance in (
            ("both ways", damaged, DISARMING),
            ("from the board", misheard, dict.fromkeys(DISARMING, frozenset({"wheel_reversed"}))),
        )
        for share in ("flip", "drop", "double")
    ),
    Fault(
        "Cable pulled",
        "cable pulled for 1 s",
        unplugged,
        Expected("disarmed", "link_lost", PULLED_S, ("link lost", "lines around a fault")),
        lasts_s=4.0,
        on_wire=True,
        sketches={"chefbot": latched("link_lost", BOARD_DEAD_MAN_S, "link lost")},
    ),
    Fault("Cable pulled", "cable pulled a hundred times", replugged, latched("link_lost"), on_wire=True),
    Fault(
        "Port that opens and closes",
        "port opens and closes for 3 s",
        opens_and_closes,
        latched("link_lost", 0.2 + SLACK_S, "link lost"),
        on_wire=True,
    ),
)
