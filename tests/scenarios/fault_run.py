"""One run of one fault on one robot: the robot drives, the fault is injected, and the robot's reaction is measured.

It uses the virtual clock and the true motion of the simulated robot. The driver commands at 20 Hz, whatever the answer,
so a robot that stands still does so against a command.
"""

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Mapping, MutableMapping
from contextlib import AbstractAsyncContextManager, AbstractContextManager, asynccontextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from structlog.testing import capture_logs

from chefbotd.client import CallError, ChefbotError, Client
from chefbotd.clock import run_virtual
from chefbotd.components.worker.spawn import Spawn
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from chefbotd.testing.worker import no_worker
from tests.scenarios.access import Access, unguarded
from tests.scenarios.driver import Driver
from tests.scenarios.instruments import FrameCount, StepCount, Stopwatch, is_moving
from tests.scenarios.robots import ROBOTS, settings_of, sketch_of
from tests.scenarios.wires import FASTEST_M_S

RUN_UP_S, LEAVING_S = 1.5, 1.5
LET_GO_S = 1.1
"""A driver that repeated its command through an e-stop has let go after a second."""

RESTARTED_S = 2.0
"""What damaged bytes have asked for is over by then: a board that took an ``s`` for an ``r`` has restarted."""

AHEAD = (0.2, 0.0)
"""Metres and radians per second."""

ENDED = "ended"
"""Stands for the gate's mode when there is no daemon any more to ask."""


@dataclass(frozen=True, slots=True)
class Expected:
    """The outcome that a fault has.

    ``mode`` and ``kind`` (the fault that latched, or what limits the motion) are those of the topic ``safety`` while it
    lasts; zero is on the motors within ``zero_within_s`` of its beginning and stays there (None: it drives on).
    ``logged`` are entries of the log.
    """

    mode: str = "armed"
    kind: str | None = None
    zero_within_s: float | None = None
    logged: tuple[str, ...] = ()

    @property
    def log(self) -> tuple[str, ...]:
        """Every entry that must be there: a latch and a limit are always logged."""
        if self.mode in ("disarmed", "estopped"):
            return ("safety mode changed", *self.logged)
        return ("motion limited", *self.logged) if self.kind is not None else self.logged


@dataclass(frozen=True, slots=True)
class Result:
    """What happened: ``zero_s`` and ``rest_s`` after the fault the board had its last duty and the robot moved last.

    Both are None where it drives on, at ``drives_m_s`` when the run ends. ``wrong`` says what was not as expected,
    ``not_applicable`` why the fault cannot happen there. ``outcome`` says in words what the figures do not.
    """

    robot: str
    fault: str
    zero_s: float | None
    rest_s: float | None
    drives_m_s: float | None
    frames_lost: int
    clients_lost: int
    wrong: tuple[str, ...]
    not_applicable: str = ""
    outcome: str = ""


def broken(robot_name: str, fault_name: str, error: Exception) -> Result:
    """The result of a run that failed with an error."""
    return Result(robot_name, fault_name, None, None, None, 0, 0, (f"no outcome: {error!r}",))


def not_applicable(robot_name: str, fault_name: str, reason: str) -> Result:
    """The result where there is nothing that the fault could happen to."""
    return Result(robot_name, fault_name, None, None, None, 0, 0, (), reason)


@dataclass(slots=True)
class FaultRun:
    """What a fault may lay hands on."""

    robot: SimulatedRobot
    driver: Driver
    access: Access
    wrong: list[str] = field(default_factory=list)

    async def told(self) -> tuple[str, str | None]:
        """The mode, and the fault that latched or what limits the motion."""
        try:
            safety = (await self.robot.client.call("get_state"))["safety"]
        except ChefbotError:
            return ENDED, None
        return safety["mode"], safety["fault"] or safety["limited_by"]

    async def topic(self, name: str) -> dict[str, Any]:
        """A topic's latest data."""
        data: dict[str, Any] = (await self.robot.client.call("get_state"))["topics"][name]["data"]
        return data

    async def odometry_error_m(self) -> float:
        """How far odometry is from the truth."""
        odometry, true = await self.topic("odometry"), self.robot.board.truth(0.0).world_from_base
        return math.dist((odometry["x_m"], odometry["y_m"]), (true.x_m, true.y_m))

    @asynccontextmanager
    async def another(self, name: str, role: str = "drive") -> AsyncIterator[Client]:
        """One more client, with a name and what it needs to come in."""
        host, port = await self.robot.daemon.server.address()
        async with Client.connect(host, port, name=name, **self.access.key(role)) as client:
            yield client

    def check(self, holds: bool, complaint: str) -> None:
        """Note what is not as it should be."""
        if not holds:
            self.wrong.append(complaint)


Inject = Callable[[FaultRun], AbstractAsyncContextManager[None]]


SAME_PROGRAM = {"emulated": "chefbot"}
"""What is expected of an image is what is expected of its model."""


@dataclass(frozen=True, slots=True)
class Fault:
    """Entering ``inject`` makes it happen, leaving it ``lasts_s`` later takes it away.

    ``row`` is how its row of docs/safety.md begins. ``leave`` is the twist by which the robot shows that it is as good
    as new. Only faults ``on_wire`` may cost frames. ``sketches`` has the outcome on those of the published ones on which
    it is another, or why the fault cannot happen there. ``spawn_worker`` starts the worker of a robot with a lidar.
    ``by_chance`` are the faults that may latch instead of what is expected, by which bytes are hit: then the robot
    stands. That is judged when it is over, and the robot was never faster than ``FASTEST_M_S``.
    """

    row: str
    name: str
    inject: Inject
    expected: Expected
    lasts_s: float = 3.0
    twist: tuple[float, float] = AHEAD
    leave: tuple[float, float] = AHEAD
    on_wire: bool = False
    overrides: Mapping[str, object] = field(default_factory=dict)
    robots: tuple[str, ...] = ROBOTS
    access: Callable[[], AbstractContextManager[Access]] = unguarded
    sketches: Mapping[str, Expected | str] = field(default_factory=dict)
    spawn_worker: Spawn = no_worker
    by_chance: frozenset[str] = frozenset()

    def outcome_on(self, robot_name: str) -> Expected | str:
        """The one outcome on this robot and its sketch, or why there is none."""
        sketch = sketch_of(robot_name)
        return self.sketches.get(SAME_PROGRAM.get(sketch, sketch), self.expected)


def motion(
    zero_s: float, rest_s: float, speed_m_s: float, *, stops: bool
) -> tuple[float | None, float | None, float | None]:
    """The figures of a ``Result`` for a robot that stops, or for one that drives on."""
    return (zero_s, rest_s, None) if stops else (None, None, speed_m_s)


def attempt(fault: Fault, robot_name: str) -> Result:
    """Let it happen to a fresh robot."""
    expected = fault.outcome_on(robot_name)
    if isinstance(expected, str):
        return not_applicable(robot_name, fault.name, expected)
    fault = replace(fault, expected=expected)
    outcomes: list[tuple[Result, Expected]] = []
    wrong: list[str] = []
    with capture_logs() as log, fault.access() as access:
        settings = settings_of(robot_name, {**fault.overrides, **access.overrides})

        async def run() -> None:
            async with simulated_robot(settings, **access.key(), spawn_worker=fault.spawn_worker) as robot:
                await asyncio.sleep(1.0)
                fault_run = FaultRun(robot, Driver(robot, fault.twist, access.key("drive")), access, wrong)
                outcomes.append(await _measured(fault, robot_name, fault_run))
                await fault_run.driver.leave()

        try:
            run_virtual(run())
        except* Exception:  # whatever ended the daemon, where it must end
            if fault.expected.mode != ENDED:
                raise
    result, expected = outcomes[0]
    return replace(result, wrong=(*wrong, *_unlogged(expected, log)))


def _unlogged(expected: Expected, log: list[MutableMapping[str, Any]]) -> list[str]:
    entries = {entry["event"] for entry in log}
    return [f"log has no {event!r}" for event in expected.log if event not in entries]


async def _measured(fault: Fault, robot_name: str, fault_run: FaultRun) -> tuple[Result, Expected]:
    """The fault, what it does, and the way out of it; with what was expected of it."""
    frames, steps = FrameCount(fault_run.robot), StepCount(fault_run.robot)
    await asyncio.sleep(RUN_UP_S)
    fault_run.check(is_moving(fault_run.robot), "did not drive in the first place")
    async with fault.inject(fault_run):
        watch = Stopwatch(fault_run.robot)
        await asyncio.sleep(fault.lasts_s)
        if not fault.by_chance:
            await watch.stop()
            told = await fault_run.told()
    if fault.by_chance:
        await asyncio.sleep(RESTARTED_S)
        await watch.stop()
        told = await fault_run.told()
        fault = replace(fault, expected=_of_chance(fault, *told))
        fault_run.check(watch.fastest_m_s < FASTEST_M_S, f"drove at {watch.fastest_m_s:.2f} m/s")
    ended = told[0] == ENDED
    fault_run.check(told == (fault.expected.mode, fault.expected.kind), f"told as {told}")
    _check_motion(fault.expected, fault_run, watch)
    speed_m_s = fault_run.robot.board.truth(0.0).twist.linear_m_s
    if not ended:
        await _leave(fault, fault_run)
    frames_lost, clients_lost = 0 if ended else frames.lost, fault_run.driver.lost + ended
    fault_run.check(ended or not clients_lost, "lost a client")
    fault_run.check(fault.on_wire or not frames_lost, f"lost {frames_lost} frames")
    fault_run.check(ended or fault.on_wire or not steps.missed, f"missed {steps.missed} control steps")
    moved = motion(watch.zero_s, watch.rest_s, speed_m_s, stops=fault.expected.zero_within_s is not None)
    return Result(robot_name, fault.name, *moved, frames_lost, clients_lost, ()), fault.expected


def _of_chance(fault: Fault, mode: str, kind: str | None) -> Expected:
    """What is expected where this latched: that the robot stands when the fault is gone."""
    if mode != "disarmed" or kind not in fault.by_chance:
        return fault.expected
    return Expected(mode, kind, fault.lasts_s + RESTARTED_S, fault.expected.logged)


def _check_motion(expected: Expected, fault_run: FaultRun, watch: Stopwatch) -> None:
    fault_run.check(not fault_run.robot.board.truth(0.0).in_contact, "ran into something")
    if expected.zero_within_s is None:
        fault_run.check(is_moving(fault_run.robot), "does not drive on")
    else:
        fault_run.check(watch.zero_s <= expected.zero_within_s, f"duty for {watch.zero_s:.3f} s")
        fault_run.check(not is_moving(fault_run.robot), "is not at rest")


async def _leave(fault: Fault, fault_run: FaultRun) -> None:
    """Arm where it latched, see that nothing moves by that, and drive as if nothing had been."""
    robot, driver, (linear_m_s, _) = fault_run.robot, fault_run.driver, fault.leave
    driver.twist, driver.says = fault.leave, driver.drive
    if fault.expected.mode != "armed":
        driver.says = None
        await asyncio.sleep(LET_GO_S)
        try:
            await robot.client.arm()
        except CallError as refusal:
            fault_run.check(False, f"cannot be armed: {refusal}")
        await asyncio.sleep(0.3)
        fault_run.check(not any(robot.board.duty) and not is_moving(robot), "jumps when armed")
        driver.says = driver.drive
    await asyncio.sleep(LEAVING_S)
    off_m_s = abs(robot.board.truth(0.0).twist.linear_m_s - linear_m_s)
    fault_run.check(off_m_s < 0.05 * abs(linear_m_s), "does not drive again")
