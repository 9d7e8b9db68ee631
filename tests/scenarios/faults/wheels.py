"""What happens to the wheels, the battery and the way ahead."""

import asyncio
import itertools
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from functools import partial

from chefbotd.client import Client
from chefbotd.core.events import SafetyChanged
from chefbotd.settings import load, packaged
from tests.scenarios.driver import PERIOD_S
from tests.scenarios.fault_run import Expected, Fault, FaultRun, Inject
from tests.scenarios.faults.outcomes import (
    AT_ONCE_S,
    BOARD_DEAD_MAN_S,
    DRIVES_ON,
    NO_BATTERY,
    NO_RANGE_SENSOR,
    SLACK_S,
    drives_on,
    estopped,
    latched,
    rests,
)
from tests.scenarios.robots import CYCLE_S
from tests.scenarios.wires import (
    Rewrite,
    frozen,
    jumping,
    reversed_from_now,
    rewire,
    rewire_motor,
    slipping,
    transport_of,
)

EDGE_LINE = b"q"
RANGE_LINE = {"chefbot": b"u", "khan": b"a"}


@asynccontextmanager
async def rewired(kind: bytes, rewrite: Rewrite, fault_run: FaultRun) -> AsyncIterator[None]:
    """What the board says of this kind is something else."""
    transport = transport_of(fault_run.robot)
    feed = transport.feed
    rewire(fault_run.robot, kind, rewrite)
    yield
    transport.feed = feed


def broken_encoder(broken: Callable[[], Rewrite]) -> Inject:
    """This encoder counts wrongly."""
    return lambda fault_run: rewired(b"e", broken(), fault_run)


@asynccontextmanager
async def rocked(index: int, period_s: float, fault_run: FaultRun) -> AsyncIterator[None]:
    """This encoder is unplugged while the driver changes his mind again and again."""
    turns = itertools.count()
    every = max(1, round(period_s / 2 / PERIOD_S))

    async def rock(client: Client) -> None:
        way = 1 if next(turns) // every % 2 else -1
        await client.drive(way * fault_run.driver.twist[0], 0.0)

    fault_run.driver.says = rock
    async with rewired(b"e", frozen(index), fault_run):
        yield


def swapped_encoders(fault_run: FaultRun) -> AbstractAsyncContextManager[None]:
    """Left and right are exchanged."""
    return rewired(b"e", lambda counts: counts[::-1], fault_run)


@asynccontextmanager
async def reversed_motor(index: int, fault_run: FaultRun) -> AsyncIterator[None]:
    """This motor's wires were exchanged."""
    device, transport = fault_run.robot.device, transport_of(fault_run.robot)
    write, feed = device.on_write, transport.feed
    rewire_motor(fault_run.robot, index)
    yield
    device.on_write, transport.feed = write, feed


@asynccontextmanager
async def too_strong(fault_run: FaultRun) -> AsyncIterator[None]:
    """Somebody sets a feedforward that is many times too large while it drives slowly."""
    client = fault_run.robot.client
    await client.set_pid("all", kv=20_000.0)
    yield
    await client.call("undo_pid")


@asynccontextmanager
async def deaf(fault_run: FaultRun) -> AsyncIterator[None]:
    """The board reads nothing more, and the driver asks it to stop."""
    device = fault_run.robot.device
    write, device.on_write = device.on_write, lambda data: None

    async def stop(client: Client) -> None:
        await client.stop()

    fault_run.driver.says = stop
    yield
    device.on_write = write


@asynccontextmanager
async def estopped_and_deaf(fault_run: FaultRun) -> AsyncIterator[None]:
    """The same, and somebody presses the emergency stop."""
    async with deaf(fault_run):
        await fault_run.robot.client.estop("it does not stop")
        yield


@asynccontextmanager
async def pushed(fault_run: FaultRun) -> AsyncIterator[None]:
    """The driver lets go; somebody rolls the robot on, a metre in three seconds."""
    fault_run.driver.says = None
    await fault_run.robot.client.stop()
    await asyncio.sleep(1.0)
    pushed_counts, step = 0, 40

    def push(counts: list[bytes]) -> list[bytes]:
        nonlocal pushed_counts
        pushed_counts += step
        return [b"%d" % (int(count) + pushed_counts) for count in counts]

    rewire(fault_run.robot, b"e", push)
    yield
    step = 0


def pieces_of_commands(duties: list[bytes]) -> list[bytes]:
    """What a receive buffer that overflowed left of several lines."""
    if b"." in duties[0]:
        return [b"6637.00", *[b"0.00"] * (len(duties) - 1)]
    *echo, of = duties
    return [b"6637", *[b"0"] * (len(echo) - 1), of]


@asynccontextmanager
async def excluded(index: int, fault_run: FaultRun) -> AsyncIterator[None]:
    """This wheel slips again and again: it is named, and odometry does without it."""
    names = (await fault_run.topic("wheels"))["name"]
    said: set[str] = set()

    async def listen() -> None:
        async for event in fault_run.robot.client.subscribe("wheels", policy="ordered"):
            said.update(event.data.excluded)

    listening = asyncio.create_task(listen())
    async with rewired(b"e", slipping(index), fault_run):
        yield
        fault_run.check(said == {names[index]}, f"left out: {said}")
    listening.cancel()
    await asyncio.gather(listening, return_exceptions=True)


def critical_battery(fault_run: FaultRun) -> AbstractAsyncContextManager[None]:
    """The ADC says 0.3 V less than the critical voltage."""
    battery = load(packaged(fault_run.robot.client.hello.robot)).battery
    share = (battery.critical_v - 0.3) / (battery.reference_v * battery.divider_ratio)
    level = share * battery.adc_full_scale

    def rewrite(levels: list[bytes]) -> list[bytes]:
        return [b"%.2f" % level if b"." in levels[0] else b"%d" % level]

    return rewired(b"b", rewrite, fault_run)


@asynccontextmanager
async def wall(fault_run: FaultRun) -> AsyncIterator[None]:
    """A wall comes near: the fault begins with the first metre per second that the guard takes away."""
    seen = fault_run.robot.daemon.bus.subscribe(SafetyChanged, size=16)
    async with asyncio.timeout(20.0):
        async for event in seen:
            if event.limited_by is not None:
                break
    yield


@asynccontextmanager
async def wall_before_wheels(fault_run: FaultRun) -> AsyncIterator[None]:
    """The same, where the wheels are commanded each on its own."""
    names = (await fault_run.topic("wheels"))["name"]
    wheel = load(packaged(fault_run.robot.client.hello.robot)).chassis.wheels[0]
    velocity_rad_s = dict.fromkeys(names, fault_run.driver.twist[0] / wheel.radius_m)

    async def turn(client: Client) -> None:
        await client.set_wheel_velocities(velocity_rad_s)

    fault_run.driver.says = turn
    async with wall(fault_run):
        yield


def blind(fault_run: FaultRun) -> AbstractAsyncContextManager[None]:
    """The range sensor says nothing more."""
    return rewired(RANGE_LINE[fault_run.robot.client.hello.robot], lambda _: None, fault_run)


@asynccontextmanager
async def wall_of_misses(fault_run: FaultRun) -> AsyncIterator[None]:
    """A wall comes near, of which every second reading shows nothing: no echo, or a voltage of far away."""
    said = itertools.count(1)
    nothing = {b"u": b"0", b"a": b"300.00"}

    def rewrite(fields: list[bytes]) -> list[bytes]:
        return fields if next(said) % 2 else [*fields[:-1], nothing[kind]]

    kind = RANGE_LINE[fault_run.robot.client.hello.robot]
    async with rewired(kind, rewrite, fault_run), wall(fault_run):
        yield


def lost_edges(every: int, fault_run: FaultRun) -> AbstractAsyncContextManager[None]:
    """Of the lines that tell edges one in so many never comes."""
    said = itertools.count(1)
    return rewired(EDGE_LINE, lambda fields: None if next(said) % every == 0 else fields, fault_run)


BROKEN_ENCODERS = (
    ("Wheel blocked", "encoder unplugged", frozen, latched("wheel_stalled", 2.2)),
    (
        "Encoder or motor wired backwards",
        "encoder reversed",
        reversed_from_now,
        latched("wheel_reversed", 0.6),
    ),
    (
        "Encoder that jumps",
        "encoder jumps",
        jumping,
        latched("encoder_jumps", 0.5, "impossible encoder jump refused"),
    ),
)
OBSTACLE_S = 3.0
OBSTACLE = Expected("armed", "obstacle:front", OBSTACLE_S)

FAULTS = (
    *(
        Fault(
            row,
            f"{what}, wheel {wheel}",
            broken_encoder(partial(broken, wheel)),
            expected,
            on_wire=True,
            robots=("chefbot", "khan") if wheel < 2 else ("khan",),
        )
        for wheel in range(4)
        for row, what, broken, expected in BROKEN_ENCODERS
    ),
    *(
        Fault(
            "Wheel blocked",
            f"encoder unplugged, rocked every {period_s:g} s",
            partial(rocked, 0, period_s),
            latched("wheel_stalled", 3.0),
            lasts_s=8.0,
            on_wire=True,
        )
        for period_s in (0.4, 1.0, 2.0)
    ),
    *(
        Fault(
            "Encoder or motor wired backwards",
            f"motor reversed, wheel {wheel}",
            partial(reversed_motor, wheel),
            latched("wheel_reversed", 1.4),  # the other wheel of KHAN's side holds it by its tyres
            robots=("chefbot", "khan") if wheel < 2 else ("khan",),
        )
        for wheel in range(4)
    ),
    Fault(
        "Encoder or motor wired backwards",
        "encoders swapped",
        swapped_encoders,
        latched("wheel_reversed", 1.2),
        twist=(0.0, 1.0),
        on_wire=True,
    ),
    Fault(
        "Wheel much faster than asked",
        "feedforward many times too large",
        too_strong,
        latched("overspeed", 0.9),
    ),
    Fault(
        "Moves although told to stand",
        "board reads nothing, stop",
        deaf,
        Expected("disarmed", "board_unresponsive"),
        on_wire=True,
        sketches={"chefbot": rests(BOARD_DEAD_MAN_S)},
    ),
    Fault(
        "Moves although told to stand",
        "board reads nothing, estop",
        estopped_and_deaf,
        Expected("estopped", "board_unresponsive", logged=("the robot moves although it must stand",)),
        on_wire=True,
        sketches={"chefbot": estopped(BOARD_DEAD_MAN_S)},
    ),
    Fault("Pushed by hand while it stands", "pushed by hand", pushed, rests(AT_ONCE_S), on_wire=True),
    Fault(
        "Board carries out other commands",
        "echo of pieces of commands",
        partial(rewired, b"s", pieces_of_commands),
        latched("echo_mismatch", 0.5),
        on_wire=True,
    ),
    *(
        Fault(
            "A wheel of four disagrees",
            f"wheel {wheel} slips",
            partial(excluded, wheel),
            drives_on("wheels disagree with their side and are excluded from odometry"),
            on_wire=True,
            robots=("khan",),
        )
        for wheel in range(4)
    ),
    Fault(
        "Battery critical",
        "battery critical",
        critical_battery,
        latched("battery_critical", 5.0 + 2 * CYCLE_S + SLACK_S),
        lasts_s=7.0,
        on_wire=True,
        sketches=NO_BATTERY,
    ),
    Fault(
        "Obstacle ahead",
        "wall ahead",
        wall,
        OBSTACLE,
        lasts_s=5.0,
        leave=(-0.2, 0.0),
        sketches=NO_RANGE_SENSOR,
    ),
    Fault(
        "A range sensor misses",
        "wall ahead, every second reading missing",
        wall_of_misses,
        OBSTACLE,
        lasts_s=5.0,
        on_wire=True,
        leave=(-0.2, 0.0),
        sketches=NO_RANGE_SENSOR,
    ),
    Fault(
        "Wheel commands towards an obstacle",
        "wall ahead, wheels commanded",
        wall_before_wheels,
        OBSTACLE,
        lasts_s=5.0,
        leave=(-0.2, 0.0),
        sketches=NO_RANGE_SENSOR,
    ),
    Fault(
        "Something nearer than the fold",
        "wall ahead, fast",
        wall,
        OBSTACLE,
        twist=(0.6, 0.0),
        lasts_s=5.0,
        leave=(-0.2, 0.0),
        robots=("khan",),
    ),
    Fault(
        "Edges of an encoder lost",
        "one line of edges in 25 lost",
        partial(lost_edges, 25),
        drives_on("encoder edges were lost, so this cycle has no reading"),
        on_wire=True,
        overrides={"robot.wire": "khan_edges"},
        robots=("khan",),
    ),
    Fault(
        "A range sensor falls silent",
        "range sensor silent",
        blind,
        DRIVES_ON,
        on_wire=True,
        sketches=NO_RANGE_SENSOR,
    ),
    Fault(
        "A range sensor falls silent",
        "range sensor silent, taken for an obstacle",
        blind,
        Expected("armed", "obstacle:front", 0.5 + 0.3 + SLACK_S),
        on_wire=True,
        overrides={"safety.guard.silent_is_obstacle": True},
        sketches=NO_RANGE_SENSOR,
    ),
)
