"""A robot on the bench: a daemon that believes one configuration, in front of a simulated board that is another."""

import asyncio
import contextlib
import random
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field

from chefbotd.client import CallTimeout, Client
from chefbotd.clock import LoopClock
from chefbotd.components.doctor.algorithms.finding import Finding
from chefbotd.components.doctor.cli.diagnosis import Diagnosis
from chefbotd.components.simulation.board import BoardRunner
from chefbotd.components.simulation.lidar import LidarRunner
from chefbotd.components.simulation.process.simulated_robot import simulation_of
from chefbotd.components.simulation.simulation import board_sender, build_launchpad, build_lidars
from chefbotd.link.port import LinkParameters
from chefbotd.process.build import build
from chefbotd.process.own_daemon import alone
from chefbotd.settings import Settings, load
from chefbotd.testing.transport import FakeSerialDevice
from chefbotd.testing.worker import no_worker

Cable = Callable[[bytes], bytes]


def straight(data: bytes) -> bytes:
    """A cable in order."""
    return data


@dataclass
class Bench:
    """The robot's client, its board with the truth in it, and its cable."""

    robot: Client
    board: BoardRunner
    device: FakeSerialDevice


@dataclass
class Answers:
    """Somebody who answers by the first words of a question, after doing what is asked; None for anything else."""

    by_question: dict[str, str] = field(default_factory=dict)
    doing: dict[str, Callable[[], Awaitable[None]]] = field(default_factory=dict)
    asked: list[str] = field(default_factory=list)

    async def ask(self, question: str) -> str | None:
        """Do it, and answer."""
        self.asked.append(question)
        for begin, deed in self.doing.items():
            if begin in question:
                await deed()
        return next((answer for begin, answer in self.by_question.items() if begin in question), None)


def configured(robot: str | None = None, **overrides: object) -> Settings:
    """A packaged robot with some keys changed; a dot is written as two underscores."""
    from chefbotd.settings import packaged

    path = None if robot is None else packaged(robot)
    return load(path, overrides={key.replace("__", "."): value for key, value in overrides.items()})


def diagnosis_of(
    settings: Settings, asker: Answers, *, seconds: float = 3.0, motors: bool = False
) -> Diagnosis:
    """A diagnosis that opens no real port."""
    return Diagnosis(settings, asker, _quiet, FakeSerialDevice().open, LoopClock(), seconds, motors)


def _quiet(_finding: Finding) -> None:
    """Print nothing."""


def found(diagnosis: Diagnosis) -> dict[str, Finding]:
    """The findings by their checks."""
    return {finding.check: finding for finding in diagnosis.findings}


@contextlib.asynccontextmanager
async def bench(
    believed: Settings, real: Settings | None = None, *, outward: Cable = straight, inward: Cable = straight
) -> AsyncIterator[Bench]:
    """Run both on the running loop's clock; ``outward`` and ``inward`` are what the cable does to the bytes."""
    simulation = simulation_of(real or believed)
    device = FakeSerialDevice()
    send = board_sender(simulation, lambda data: device.feed(inward(data)), lambda: device.transport)
    board = BoardRunner(build_launchpad(simulation), send, LoopClock())
    device.on_write = lambda data: board.receive(outward(data))
    by_path: dict[str, FakeSerialDevice] = {}
    runners = []
    for configured_lidar, (_, lidar) in zip(believed.lidar, build_lidars(simulation).items(), strict=True):
        by_path[configured_lidar.device] = plugged = FakeSerialDevice()
        runners.append(LidarRunner(lidar, board, plugged.feed, LoopClock()).run())

    async def opener(link: LinkParameters, protocol: asyncio.BaseProtocol) -> asyncio.Transport:
        return await by_path.get(link.device, device).open(link, protocol)

    living = [asyncio.create_task(each) for each in (board.run(), *runners)]
    daemon = build(
        alone(believed),
        clock=LoopClock(),
        opener=opener,
        rng=random.Random(1),
        substitutes={"worker": no_worker},
    )
    living.append(asyncio.create_task(daemon.run()))
    try:
        host, port = await daemon.server.address()
        async with Client.connect(host, port, name="bench") as robot:
            with contextlib.suppress(CallTimeout):  # a board of which nothing is heard never lets it move
                await robot.wait_until_armed(timeout_s=1.0)
            yield Bench(robot, board, device)
    finally:
        for task in reversed(living):
            task.cancel()
        await asyncio.gather(*living, return_exceptions=True)
