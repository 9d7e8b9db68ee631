"""What ends a procedure, and how that is said, with a driver that only counts."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import cast

import numpy as np
import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.calibration.algorithms.step import Ask, Move, Procedure
from chefbotd.components.calibration.procedure_runner import ProcedureRunner
from chefbotd.core.commands import Refused
from chefbotd.core.events import SafetyChanged, WheelsMeasured
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import ORIGIN, Motion, Twist2D
from chefbotd.core.scan import LaserScan
from chefbotd.driving.inner_driver import InnerDriver


class Driver:
    """Takes every motion."""

    source, stops, stopped_by, latch = "calibration", 0, "", 0

    def __init__(self) -> None:
        self.driven = 0

    @property
    def stop_number(self) -> int:
        """Of the last stop or fault."""
        return self.stops + self.latch

    def begin(self, stop_number: int, what: str) -> None:
        """Begin what was asked for since then."""
        assert stop_number == self.stop_number, what

    def drive(self, motion: Motion, wished_s: float) -> None:
        """Drive."""
        self.driven += 1

    def let_go(self) -> None:
        """Let go."""


class Robot:
    """What the runner hears of a robot: its mode, and wheels that turn at ``turning_rad_s``."""

    def __init__(self, *, turning_rad_s: float = 0.0) -> None:
        self.bus, self.driver, self.turning_rad_s = Bus(), Driver(), turning_rad_s
        self.runner = ProcedureRunner(
            self.bus, LoopClock(), cast("InnerDriver", self.driver), lambda action: None
        )

    async def run(self, procedure: Procedure) -> None:
        """Run it from now on."""
        await self.runner.run(procedure, self.runner.take_baseline())

    def tell(self, mode: str, latch: int, *, limited_by: str | None = None) -> None:
        """Publish the gate's state."""
        self.driver.latch = latch
        now_s = asyncio.get_running_loop().time()
        reason = "" if mode == "armed" else "a wheel is stuck"
        self.bus.publish(SafetyChanged(now_s, mode, reason, "calibration", None, limited_by, latch))

    def tell_wheels(self) -> None:
        """Publish one reading of the wheels."""
        now_s, speed = asyncio.get_running_loop().time(), (self.turning_rad_s, self.turning_rad_s)
        self.bus.publish(WheelsMeasured(now_s, now_s, now_s, (0.0, 0.0), (0.0, 0.0), speed))

    @contextlib.asynccontextmanager
    async def measuring(self) -> AsyncIterator[None]:
        """The wheels are told of, and a lidar's turns."""

        async def measure() -> None:
            scan = LaserScan(0.0, np.zeros(1), np.ones(1), np.zeros(1))
            while True:
                self.tell_wheels()
                self.bus.publish(ScanMeasured(asyncio.get_running_loop().time(), "front", ORIGIN, scan))
                await asyncio.sleep(0.05)

        task = asyncio.create_task(measure())
        try:
            yield
        finally:
            task.cancel()


def _drives() -> Procedure:
    yield Move(Twist2D(0.1, 0.0), 0.5, "drives")


@pytest.mark.parametrize(
    ("limited_by", "words"),
    [
        (None, "the wheels did not come to rest within 3 s$"),
        ("no_echo", "calibrate where something stands within 4 m ahead of the robot$"),
    ],
)
def test_wheels_that_never_rest_end_a_step(limited_by: str | None, words: str) -> None:
    """They turn on for 3 s after the motion: that is said, and of a board without an echo what to do about it."""

    async def run() -> None:
        robot = Robot(turning_rad_s=1.0)
        robot.tell("armed", 7, limited_by=limited_by)
        async with robot.measuring():
            await asyncio.sleep(0.1)
            with pytest.raises(Refused, match=words):
                await robot.run(_drives())

    run_virtual(run())


def _drives_far() -> Procedure:
    yield Move(Twist2D(0.3, 0.0), 5.0, "drives far", settled=False)


def test_a_robot_that_an_obstacle_holds_ends_a_step() -> None:
    """It is limited and its wheels stand for 1 s: something is in the way."""

    async def run() -> None:
        robot, loop = Robot(), asyncio.get_running_loop()
        robot.tell("armed", 7, limited_by="obstacle:front")
        began_s = loop.time()
        async with robot.measuring():
            await asyncio.sleep(0.01)
            with pytest.raises(Refused, match=r"something is in the way \(obstacle:front\)"):
                await robot.run(_drives_far())
        assert loop.time() - began_s == pytest.approx(1.05, abs=0.06)

    run_virtual(run())


def test_a_robot_that_an_obstacle_only_slows_goes_on() -> None:
    """Limited for 5 s and on its way; held for 0.9 s of them, which a robot with heavy wheels takes to start."""

    async def run() -> None:
        robot, loop = Robot(turning_rad_s=1.5), asyncio.get_running_loop()
        robot.tell("armed", 7, limited_by="obstacle:front")
        loop.call_later(2.0, setattr, robot, "turning_rad_s", 0.0)
        loop.call_later(2.9, setattr, robot, "turning_rad_s", 1.5)
        began_s = loop.time()
        async with robot.measuring():
            await asyncio.sleep(0.01)
            await robot.run(_drives_far())
        assert loop.time() - began_s > 5.0

    run_virtual(run())


def test_a_board_that_falls_silent_ends_a_step() -> None:
    """Without a reading of the wheels for 2 s nothing is driven any more."""

    async def run() -> None:
        robot, loop = Robot(turning_rad_s=1.0), asyncio.get_running_loop()
        robot.tell("armed", 7)
        robot.tell_wheels()
        now_s = loop.time()
        with pytest.raises(Refused, match="has not told of its wheels for 2 s"):
            await robot.run(_drives())
        assert loop.time() - now_s < 3.0

    run_virtual(run())


def test_a_fault_that_is_cleared_at_once_ends_a_motion() -> None:
    """Disarmed and armed again between two commands: nothing is driven after it."""

    async def run() -> None:
        robot = Robot()
        robot.tell("armed", 7)
        async with robot.measuring():
            running = asyncio.create_task(robot.run(_drives()))
            await asyncio.sleep(0.12)
            robot.tell("disarmed", 8)
            robot.tell("armed", 8)
            driven = robot.driver.driven
            assert driven > 0
            with pytest.raises(Refused, match="a fault stopped the robot meanwhile"):
                await running
            assert robot.driver.driven == driven

    run_virtual(run())


def _asks_and_drives() -> Procedure:
    yield Ask("voltage_v", "What does a voltmeter say?", "V", 5.0, 20.0, 0.5)
    yield from _drives()


@pytest.mark.parametrize(
    ("modes", "is_answered", "words"),
    [
        (("disarmed", "armed"), True, "a fault stopped the robot meanwhile"),
        (("disarmed",), False, "the robot is stopped .a wheel is stuck.; arm the robot first"),
    ],
)
def test_a_fault_while_a_question_waits_ends_the_step(
    modes: tuple[str, ...], is_answered: bool, words: str
) -> None:
    """One that is cleared before the answer, whose answer then moves nothing, and one that nobody clears."""

    async def run() -> None:
        robot = Robot()
        robot.tell("armed", 7)
        async with robot.measuring():
            running = asyncio.create_task(robot.run(_asks_and_drives()))
            await asyncio.sleep(2.5)
            for mode in modes:
                robot.tell(mode, 8)
            if is_answered:
                robot.runner.answer("voltage_v", 12.0)
            with pytest.raises(Refused, match=words):
                await running
            assert robot.driver.driven == 0

    run_virtual(run())


def test_nothing_begins_before_the_mode_is_known() -> None:
    """A robot of which it is not known whether it is armed is not driven."""

    async def run() -> None:
        robot = Robot()
        robot.tell_wheels()
        with pytest.raises(Refused, match="not known yet whether the robot may move"):
            await robot.run(_drives())

    run_virtual(run())


def test_no_scans_are_kept_while_a_question_waits() -> None:
    """A question of 100 s leaves 2000 readings of the wheels and no scan; a motion of 0.5 s has its ten scans."""

    async def run() -> None:
        robot = Robot()
        robot.tell("armed", 7)
        parts = []

        def procedure() -> Procedure:
            parts.append((yield Ask("voltage_v", "What does a voltmeter say?", "V", 5.0, 20.0, 0.5)))
            parts.append((yield Move(None, 0.5, "stands")))

        async with robot.measuring():
            running = asyncio.create_task(robot.run(procedure()))
            await asyncio.sleep(99.5)
            robot.runner.answer("voltage_v", 12.0)
            await running
        asked, stood = parts
        assert len(asked.wheels) == pytest.approx(2000, abs=2)
        assert asked.scans == ()
        assert len(stood.scans) == pytest.approx(10, abs=1)

    run_virtual(run())
