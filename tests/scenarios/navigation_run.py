"""One fault that befalls a robot on its way to a goal: what the robot does, how the goal ends, and the way out.

It is on the virtual clock, in the simulated flat, and held against the true motion.
"""

import asyncio
import tempfile
from collections.abc import Callable, Mapping
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from structlog.testing import capture_logs

from chefbotd.client import ChefbotError
from chefbotd.client.errors import GoalNotReached
from chefbotd.testing.daemon import SimulatedRobot
from tests.scenarios.fault_run import Result
from tests.scenarios.instruments import FrameCount, StepCount, Stopwatch
from tests.scenarios.on_the_way import GOAL, Drive, in_flat

ENDS_S = 40.0
"""The whole leg takes 8 s where nothing happens."""

REACHED_M = 0.06
REST_S = 0.5

Inject = Callable[[Drive], AbstractAsyncContextManager[None]]


def nothing_before(robot: SimulatedRobot) -> None:
    """The robot is as it should be."""


@dataclass(frozen=True, slots=True)
class WayFault:
    """Entering ``inject`` makes it happen to a robot that drives, leaving it ``lasts_s`` later takes it away.

    The goal has the one end ``end``, with ``reason`` in its sentence. The robot rests within ``rest_s`` of the fault's
    beginning and as long as it lasts (None: it may drive on). ``before`` is called before the robot knows where it is.
    Where ``drives_after``, the goal is reached when it is asked for again, once the fault is over. ``begins_at_y_m`` is
    how far the robot has come when it happens: the door is at 3.2 to 3.5 m.
    """

    row: str
    name: str
    inject: Inject
    end: str = "reached"
    reason: str = ""
    rest_s: float | None = None
    lasts_s: float = 2.0
    begins_at_y_m: float | None = None
    never_drives: bool = False
    drives_after: bool = False
    before: Callable[[SimulatedRobot], None] = nothing_before
    overrides: Mapping[str, object] = field(default_factory=dict)
    zones: str = ""
    goal: Mapping[str, float] = field(default_factory=lambda: GOAL)
    logged: tuple[str, ...] = ()
    robots: tuple[str, ...] = ("chefbot",)


class WayRun:
    """One run; ``wrong`` is what was not as expected."""

    def __init__(self, fault: WayFault, drive: Drive) -> None:
        self._fault, self._drive = fault, drive
        self.wrong: list[str] = []
        self.zero_s: float | None = None
        self.rest_s: float | None = None

    async def run(self) -> None:
        """The way, the fault, the end of the goal, and the way out."""
        fault, drive = self._fault, self._drive
        leg = drive.begin(**fault.goal)
        if not fault.never_drives:
            await self._until_there()
        async with fault.inject(drive):
            watch = Stopwatch(drive.robot)
            await asyncio.sleep(fault.lasts_s)
            await watch.stop()
        self._check_rest(watch)
        await self._check_end(leg)
        if fault.drives_after:
            await self._check_way_out()
        self.check(not drive.truth.in_contact, "ran into something")

    async def _until_there(self) -> None:
        await self._drive.until_driving()
        async with asyncio.timeout(20.0):
            wanted_m = self._fault.begins_at_y_m
            while wanted_m is not None and self._drive.truth.world_from_base.y_m < wanted_m:  # noqa: ASYNC110 - the truth has no event
                await asyncio.sleep(0.02)

    def _check_rest(self, watch: Stopwatch) -> None:
        if self._fault.rest_s is None:
            return
        self.zero_s, self.rest_s = watch.zero_s, watch.rest_s
        self.check(watch.rest_s <= self._fault.rest_s, f"moved for {watch.rest_s:.2f} s")

    async def _check_end(self, leg: "asyncio.Task[str]") -> None:
        try:
            end, reason = "reached", await asyncio.wait_for(leg, ENDS_S)
        except GoalNotReached as told:
            end, reason = told.end, told.reason
        except TimeoutError:
            end, reason = "none", "the goal did not end"
        except asyncio.CancelledError:
            end, reason = self._drive.told[-1].state, self._drive.told[-1].reason
        except ChefbotError as refused:
            end, reason = "refused", str(refused)
        self.check(end == self._fault.end, f"ended as {end}: {reason}")
        self.check(self._fault.reason in reason, f"said {reason!r}")
        if end == "reached":
            off_m, _ = self._drive.off()
            self.check(off_m < REACHED_M, f"{off_m:.3f} m off")
            return
        await asyncio.sleep(REST_S)
        self.check(self._drive.speed_m_s < 0.005, "is not at rest after the end")

    async def _check_way_out(self) -> None:
        """With the fault gone, the same goal is reached."""
        client = self._drive.client
        if (await client.get_state()).safety.mode != "armed":
            await client.arm()
        try:
            await asyncio.wait_for(client.navigate_to(**GOAL), ENDS_S)
        except (ChefbotError, TimeoutError) as problem:
            self.check(False, f"is not reached again: {problem!r}")

    def check(self, holds: bool, complaint: str) -> None:
        """Note what is not as it should be."""
        if not holds:
            self.wrong.append(complaint)


def attempt(fault: WayFault, robot_name: str) -> Result:
    """Let it happen to a fresh robot."""
    results: list[Result] = []

    async def scenario(drive: Drive) -> None:
        frames, steps = FrameCount(drive.robot), StepCount(drive.robot)
        run = WayRun(fault, drive)
        await run.run()
        run.check(not frames.lost, f"lost {frames.lost} frames")
        run.check(not steps.missed, f"missed {steps.missed} control steps")
        moved = (run.zero_s, run.rest_s, None)
        outcome = f"goal {fault.end}"
        results.append(
            Result(robot_name, fault.name, *moved, frames.lost, 0, wrong=tuple(run.wrong), outcome=outcome)
        )

    with capture_logs() as log, tempfile.TemporaryDirectory(prefix="chefbotd-maps-") as folder:
        in_flat(Path(folder), scenario, fault.zones, fault.before, fault.overrides)
    (result,) = results
    return _with_log(result, fault, log)


def _with_log(result: Result, fault: WayFault, log: list[Any]) -> Result:
    entries = {entry["event"] for entry in log}
    missing = [f"log has no {event!r}" for event in fault.logged if event not in entries]
    return replace(result, wrong=(*result.wrong, *missing))
