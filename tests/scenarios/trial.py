"""One fault, one robot, one trial: it is driven, the fault happens, and what then becomes of it is measured.

All of it on the virtual clock, with the true motion of the simulated robot. The driver is stubborn: it goes on
commanding at 20 Hz, whatever it is answered, so whatever stands still does so against somebody's wish.
"""

import asyncio
import contextlib
from collections.abc import Callable, Mapping
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass, field

from chefbotd.client import CallError, Client, ClientError
from chefbotd.clock import run_virtual
from chefbotd.services.supervisor import ServiceLost
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.scenarios.instruments import FrameCount, Stopwatch, is_moving

PERIOD_S = 0.05
RUN_UP_S, LEAVING_S = 1.5, 1.5
AHEAD = (0.2, 0.0)
"""Metres and radians per second."""

ENDED = "ended"
"""Stands for the gate's mode when there is no daemon any more to ask."""


@dataclass(frozen=True, slots=True)
class Expected:
    """The one outcome that a fault may have.

    ``mode`` and ``kind`` (the fault that latched, or what limits the motion) are those of the topic ``safety`` while it
    lasts; zero is on the motors within ``zero_within_s`` of its beginning and stays there (None: it drives on).
    """

    mode: str = "armed"
    kind: str | None = None
    zero_within_s: float | None = None


@dataclass(frozen=True, slots=True)
class Result:
    """What happened: ``zero_s`` and ``rest_s`` after the fault the board had its last duty and the robot moved last.

    Both are None where it drives on, at ``drives_m_s`` when the trial ends. ``wrong`` says what was not as expected.
    """

    robot: str
    fault: str
    zero_s: float | None
    rest_s: float | None
    drives_m_s: float | None
    frames_lost: int
    clients_lost: int
    wrong: tuple[str, ...]


class Driver:
    """The stubborn client."""

    def __init__(self, robot: SimulatedRobot, twist: tuple[float, float]) -> None:
        self._robot, self.twist = robot, twist
        self.talks = True
        self.gone = False
        self._task = asyncio.create_task(self._run())

    @property
    def lost(self) -> bool:
        """Whether its connection ended and it was not its own doing."""
        return self._task.done() and not self.gone

    async def leave(self) -> None:
        """Close the connection in mid-drive."""
        self.gone = True
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)

    def come_back(self) -> None:
        """Connect again."""
        self.gone, self._task = False, asyncio.create_task(self._run())

    async def _run(self) -> None:
        host, port = await self._robot.daemon.server.address()
        async with Client.connect(host, port, name="driver") as client:
            while True:
                if self.talks:
                    with contextlib.suppress(CallError):
                        await client.drive(*self.twist)
                await asyncio.sleep(PERIOD_S)


@dataclass(slots=True)
class Trial:
    """What a fault may lay hands on."""

    robot: SimulatedRobot
    driver: Driver
    wrong: list[str] = field(default_factory=list)

    async def told(self) -> tuple[str, str | None]:
        """The mode, and the fault that latched or what limits the motion."""
        try:
            safety = (await self.robot.client.get_state())["safety"]
        except ClientError:
            return ENDED, None
        return safety["mode"], safety["fault"] or safety["limited_by"]

    def check(self, holds: bool, complaint: str) -> None:
        """Note what is not as it should be."""
        if not holds:
            self.wrong.append(complaint)


Inject = Callable[[Trial], AbstractAsyncContextManager[None]]


@dataclass(frozen=True, slots=True)
class Fault:
    """Entering ``inject`` makes it happen, leaving it ``lasts_s`` later takes it away.

    ``leave`` is the twist by which the robot shows that it is as good as new. Only faults ``on_wire`` may cost frames.
    """

    name: str
    inject: Inject
    expected: Expected
    lasts_s: float = 3.0
    twist: tuple[float, float] = AHEAD
    leave: tuple[float, float] = AHEAD
    on_wire: bool = False
    overrides: Mapping[str, object] = field(default_factory=dict)


def motion(
    zero_s: float, rest_s: float, speed_m_s: float, *, stops: bool
) -> tuple[float | None, float | None, float | None]:
    """The figures of a ``Result`` for a robot that stops, or for one that drives on."""
    return (zero_s, rest_s, None) if stops else (None, None, speed_m_s)


def attempt(fault: Fault, robot_name: str) -> Result:
    """Let it happen to a fresh robot."""
    results: list[Result] = []

    async def run() -> None:
        async with simulated_robot(load(packaged(robot_name), overrides=fault.overrides)) as robot:
            await asyncio.sleep(1.0)
            trial = Trial(robot, Driver(robot, fault.twist))
            results.append(await _measured(fault, robot_name, trial))
            await trial.driver.leave()

    try:
        run_virtual(run())
    except* ServiceLost:
        if fault.expected.mode != ENDED:
            raise
    return results[0]


async def _measured(fault: Fault, robot_name: str, trial: Trial) -> Result:
    """The fault, what it does, and the way out of it."""
    frames = FrameCount(trial.robot)
    await asyncio.sleep(RUN_UP_S)
    trial.check(is_moving(trial.robot), "did not drive in the first place")
    async with fault.inject(trial):
        watch = Stopwatch(trial.robot)
        await asyncio.sleep(fault.lasts_s)
        await watch.stop()
        told = await trial.told()
    ended = told[0] == ENDED
    trial.check(told == (fault.expected.mode, fault.expected.kind), f"told as {told}")
    _check_motion(fault.expected, trial, watch)
    speed_m_s = trial.robot.board.truth(0.0).twist.linear_m_s
    if not ended:
        await _leave(fault, trial)
    frames_lost, clients_lost = 0 if ended else frames.lost, trial.driver.lost + ended
    trial.check(ended or not clients_lost, "lost a client")
    trial.check(fault.on_wire or not frames_lost, f"lost {frames_lost} frames")
    moved = motion(watch.zero_s, watch.rest_s, speed_m_s, stops=fault.expected.zero_within_s is not None)
    return Result(robot_name, fault.name, *moved, frames_lost, clients_lost, tuple(trial.wrong))


def _check_motion(expected: Expected, trial: Trial, watch: Stopwatch) -> None:
    trial.check(not trial.robot.board.truth(0.0).in_contact, "ran into something")
    if expected.zero_within_s is None:
        trial.check(is_moving(trial.robot), "does not drive on")
    else:
        trial.check(watch.zero_s <= expected.zero_within_s, f"duty for {watch.zero_s:.3f} s")
        trial.check(not is_moving(trial.robot), "is not at rest")


async def _leave(fault: Fault, trial: Trial) -> None:
    """Arm where it latched, see that nothing moves by that, and drive as if nothing had been."""
    robot, driver, (linear_m_s, _) = trial.robot, trial.driver, fault.leave
    driver.twist = fault.leave
    if fault.expected.mode != "armed":
        driver.talks = False
        await asyncio.sleep(0.5)
        try:
            await robot.client.arm()
        except CallError as refusal:
            trial.check(False, f"cannot be armed: {refusal}")
        await asyncio.sleep(0.3)
        trial.check(not any(robot.board.duty) and not is_moving(robot), "jumps when armed")
    driver.talks = True
    await asyncio.sleep(LEAVING_S)
    off_m_s = abs(robot.board.truth(0.0).twist.linear_m_s - linear_m_s)
    trial.check(off_m_s < 0.05 * abs(linear_m_s), "does not drive again")
