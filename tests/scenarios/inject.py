"""How faults happen to the simulated robot: each is a context, entering it begins the fault and leaving it ends it."""

import asyncio
import contextlib
import random
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

from chefbotd.core.events import BatteryCounted, EncodersCounted, SafetyChanged
from chefbotd.settings import load, packaged
from chefbotd.testing.transport import FakeSerialTransport
from tests.scenarios.trial import Inject, Trial
from tests.scenarios.wires import Rewrite, damage, rewire

GARBAGE = bytes(range(256)) * 64
REPLUG_S = 1.0


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


def broken_encoder(broken: Callable[[], Rewrite]) -> Inject:
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
async def unheard(trial: Trial) -> AsyncIterator[None]:
    """Nothing that the board says arrives."""
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
async def damaged(share: str, trial: Trial) -> AsyncIterator[None]:
    """One byte in a hundred suffers, both ways."""
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
async def failing_service(times: int, trial: Trial) -> AsyncIterator[None]:
    """A reading that breaks the sensors' service."""
    for _ in range(times):
        trial.robot.daemon.bus.publish(BatteryCounted(0.0, "full"))
        await asyncio.sleep(0)
    yield


@asynccontextmanager
async def cancelled(task_name: str, trial: Trial) -> AsyncIterator[None]:
    """Somebody cancels one of the daemon's tasks."""
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
