"""The table of faults: how each happens to the simulated robot, and the one outcome that it may have.

Every bound on the time to zero is the sum of what must pass before it, which stands beside it, and of some slack:
one board cycle and one period of the driver.
"""

import asyncio
import contextlib
import random
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

from chefbotd.core.events import BatteryCounted, EncodersCounted, SafetyChanged
from chefbotd.settings import load, packaged
from chefbotd.testing.transport import FakeSerialTransport
from tests.scenarios.trial import ENDED, Expected, Fault, Inject, Trial
from tests.scenarios.wires import Rewrite, damage, frozen, jumping, reversed_from_now, rewire

SLACK_S = 0.1
AT_ONCE_S = SLACK_S
RAMP_S = 0.3
"""0.2 m/s at 1 m/s2, and the wheels' last bit of way."""

GARBAGE = bytes(range(256)) * 64
REPLUG_S, LONGEST_BACKOFF_S = 1.0, 2.0


def latched(kind: str, within_s: float = AT_ONCE_S) -> Expected:
    """Disarmed by a fault."""
    return Expected("disarmed", kind, within_s)


def rests(within_s: float) -> Expected:
    """Comes to rest, and nothing latches."""
    return Expected(zero_within_s=within_s)


DRIVES_ON = Expected()


# What the driver does


@asynccontextmanager
async def silence(trial: Trial) -> AsyncIterator[None]:
    """The driver says nothing more, but stays connected."""
    trial.driver.talks = False
    yield


@asynccontextmanager
async def departure(trial: Trial) -> AsyncIterator[None]:
    """The driver's connection ends."""
    await trial.driver.leave()
    yield
    trial.driver.come_back()


@asynccontextmanager
async def stop(trial: Trial) -> AsyncIterator[None]:
    """Somebody else says stop, and the driver lets it be."""
    trial.driver.talks = False
    await trial.robot.client.stop()
    yield


@asynccontextmanager
async def estop(trial: Trial) -> AsyncIterator[None]:
    """Somebody else presses stop in earnest; the driver does not care."""
    await trial.robot.client.estop("trial")
    yield


# What happens to the wheels, the battery and the way ahead


@asynccontextmanager
async def _rewired(kind: bytes, rewrite: Rewrite, trial: Trial) -> AsyncIterator[None]:
    transport = _transport(trial)
    feed = transport.feed
    rewire(trial.robot, kind, rewrite)
    yield
    transport.feed = feed


def broken_encoder(broken: partial[Rewrite]) -> Inject:
    """This encoder counts wrongly."""
    return lambda trial: _rewired(b"e", broken(), trial)


def swapped_encoders(trial: Trial) -> contextlib.AbstractAsyncContextManager[None]:
    """Left and right are exchanged."""
    return _rewired(b"e", lambda counts: counts[::-1], trial)


def critical_battery(trial: Trial) -> contextlib.AbstractAsyncContextManager[None]:
    """The ADC says 0.3 V less than the critical voltage."""
    battery = load(packaged(trial.robot.client.hello.robot)).battery
    share = (battery.critical_v - 0.3) / (battery.reference_v * battery.divider_ratio)
    return _rewired(b"b", lambda _: [b"%.2f" % (share * battery.adc_full_scale)], trial)


@asynccontextmanager
async def wall(trial: Trial) -> AsyncIterator[None]:
    """A wall comes near: the fault begins with the first metre per second that the guard takes away."""
    seen = trial.robot.daemon.bus.subscribe(SafetyChanged, size=16)
    async with asyncio.timeout(20.0):
        async for event in seen:
            if event.limited_by is not None:
                break
    yield


# What happens to the link and the board


@asynccontextmanager
async def _unheard(trial: Trial) -> AsyncIterator[None]:
    transport = _transport(trial)
    feed, transport.feed = transport.feed, lambda data: None
    yield
    transport.feed = feed


@asynccontextmanager
async def unplugged(trial: Trial) -> AsyncIterator[None]:
    """The cable is pulled, and put back a second later."""
    device = trial.robot.device
    device.unplug()
    asyncio.get_running_loop().call_later(REPLUG_S, device.plug)
    yield


@asynccontextmanager
async def reset(trial: Trial) -> AsyncIterator[None]:
    """The board restarts."""
    await trial.robot.client.reset_board()
    yield


@asynccontextmanager
async def _damaged(share: str, trial: Trial) -> AsyncIterator[None]:
    transport, device = _transport(trial), trial.robot.device
    feed, write = transport.feed, device.on_write
    damage(trial.robot, {share: 0.01}, seed=7)
    yield
    transport.feed, device.on_write = feed, write


@asynccontextmanager
async def noise(trial: Trial) -> AsyncIterator[None]:
    """A megabyte a second, and nothing else."""
    transport, chance = _transport(trial), random.Random(3)
    feed, transport.feed = transport.feed, lambda data: None

    async def hiss() -> None:
        while True:
            feed(chance.randbytes(10_000))
            await asyncio.sleep(0.01)

    hissing = asyncio.create_task(hiss())
    yield
    hissing.cancel()
    transport.feed = feed


@asynccontextmanager
async def deaf_board(trial: Trial) -> AsyncIterator[None]:
    """The board reads nothing for half a second, in which somebody presses stop in earnest."""
    transport = _transport(trial)
    transport.stall()
    asyncio.get_running_loop().call_later(0.5, transport.drain)
    await trial.robot.client.estop("trial")
    yield


@asynccontextmanager
async def nothing(trial: Trial) -> AsyncIterator[None]:
    """What happens is in the overrides."""
    yield


# What happens inside the program


@asynccontextmanager
async def failing_step(trial: Trial) -> AsyncIterator[None]:
    """Counts for a wheel that there is not break a control step."""
    now_s = asyncio.get_running_loop().time()
    trial.robot.daemon.bus.publish(EncodersCounted(now_s, now_s, (1, 2, 3, 4, 5)))
    yield


@asynccontextmanager
async def _failing_service(times: int, trial: Trial) -> AsyncIterator[None]:
    for _ in range(times):
        trial.robot.daemon.bus.publish(BatteryCounted(0.0, "full"))
        await asyncio.sleep(0)
    yield


@asynccontextmanager
async def _cancelled(task_name: str, trial: Trial) -> AsyncIterator[None]:
    next(task for task in asyncio.all_tasks() if task.get_name() == task_name).cancel()
    yield


# What other clients do


@asynccontextmanager
async def abuse(trial: Trial) -> AsyncIterator[None]:
    """Ten clients send garbage, ten more ask for everything and read none of it."""
    ask = b'{"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"topics":["raw"],"policy":"ordered"}}\n'
    host, port = await trial.robot.daemon.server.address()
    writers = []
    for said in [GARBAGE] * 10 + [ask] * 10:
        _, writer = await asyncio.open_connection(host, port, limit=1)
        writer.write(said)
        writers.append(writer)
    yield
    for writer in writers:
        writer.transport.abort()


def _transport(trial: Trial) -> FakeSerialTransport:
    transport = trial.robot.device.transport
    assert transport is not None
    return transport


FAULTS = (
    Fault("driver falls silent", silence, rests(0.5 + RAMP_S + SLACK_S)),
    Fault("driver's connection ends", departure, rests(RAMP_S + SLACK_S)),
    Fault("stop", stop, rests(RAMP_S + SLACK_S)),
    Fault("estop", estop, Expected("estopped", None, AT_ONCE_S)),
    *(
        Fault(
            f"{what}, wheel {wheel}",
            broken_encoder(partial(broken, wheel)),
            latched(kind, within_s),
            on_wire=True,
        )
        for wheel in (0, 1)
        for what, broken, kind, within_s in (
            ("encoder unplugged", frozen, "wheel_stalled", 2.2),
            ("encoder reversed", reversed_from_now, "wheel_reversed", 0.6),
            ("encoder jumps", jumping, "encoder_jumps", 0.5),
        )
    ),
    Fault(
        "encoders swapped", swapped_encoders, latched("wheel_reversed", 1.2), twist=(0.0, 1.0), on_wire=True
    ),
    Fault(
        "battery critical",
        critical_battery,
        latched("battery_critical", 5.0 + SLACK_S),
        lasts_s=7.0,
        on_wire=True,
    ),
    Fault("wall ahead", wall, Expected("armed", "obstacle:front", 3.0), lasts_s=5.0, leave=(-0.2, 0.0)),
    Fault(
        "board silent for 1 s",
        _unheard,
        Expected("armed", "encoders_stale", 0.25 + SLACK_S),
        1.0,
        on_wire=True,
    ),
    Fault("board silent for longer", _unheard, latched("encoders_silent", 0.25 + SLACK_S), on_wire=True),
    Fault(
        "noise at 1 MB/s for 1 s",
        noise,
        Expected("armed", "encoders_stale", 0.25 + SLACK_S),
        1.0,
        on_wire=True,
    ),
    *(
        Fault(f"1 % of bytes: {share}", partial(_damaged, f"{share}_share"), DRIVES_ON, on_wire=True)
        for share in ("flip", "drop", "double")
    ),
    Fault(
        "cable pulled for 1 s",
        unplugged,
        latched("link_lost", REPLUG_S + LONGEST_BACKOFF_S + SLACK_S),
        lasts_s=4.0,
        on_wire=True,
    ),
    Fault("board restarts", reset, latched("board_restarted"), on_wire=True),
    Fault("board reads nothing for 0.5 s", deaf_board, Expected("estopped", None, 0.5 + SLACK_S)),
    Fault("board's clock wraps", nothing, DRIVES_ON, overrides={"sim.board.boot_micros": 2**32 - 3_000_000}),
    Fault("control step fails", failing_step, latched("internal_error")),
    Fault("service raises", partial(_failing_service, 1), latched("service_failed")),
    *(
        Fault(f"service cancelled: {service}", partial(_cancelled, service), latched("service_failed"))
        for service in ("odometry", "sensors", "stats")
    ),
    Fault("service cannot run", partial(_failing_service, 6), Expected(ENDED, None, AT_ONCE_S)),
    *(
        Fault(f"task lost: {task}", partial(_cancelled, task), Expected(ENDED, None, AT_ONCE_S))
        for task in ("drive", "link")
    ),
    Fault("twenty clients misbehave", abuse, DRIVES_ON),
)
