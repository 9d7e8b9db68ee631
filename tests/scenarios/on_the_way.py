"""A robot that drives to a goal in the simulated flat: daemon, lidar and worker on one virtual clock, and the truth."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping
from functools import partial, wraps
from inspect import Signature, signature
from pathlib import Path
from types import MappingProxyType
from typing import Any

from chefbotd.clock import run_virtual
from chefbotd.components.navigation.events import NavigationChanged
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.spawn import Child
from chefbotd.core.events import SafetyChanged
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.testing.daemon import SimulatedRobot
from chefbotd.testing.on_map import localized_robot
from chefbotd.testing.worker import WorkerInProcess, worker_in_process
from tests.scenarios.robots import AS_BUILT

START = Pose2D(2.45, 2.6, 2.1)
GOAL = {"x_m": 2.6, "y_m": 4.0, "heading_rad": 0.4}
"""Through the door of the living room into the hall: 1.5 m."""


class Drive:
    """The robot on its way; ``told`` is all that navigation told."""

    def __init__(self, robot: SimulatedRobot, children: list[WorkerInProcess], folder: Path) -> None:
        self.robot, self.client, self.children, self.folder = robot, robot.client, children, folder
        self.told: list[NavigationChanged] = []
        self.safety: list[SafetyChanged] = []
        robot.daemon.bus.add_handler(self.told.append, NavigationChanged)
        robot.daemon.bus.add_handler(self.safety.append, SafetyChanged)

    @property
    def truth(self) -> Any:
        return self.robot.board.truth(asyncio.get_running_loop().time())

    @property
    def speed_m_s(self) -> float:
        return abs(float(self.truth.twist.linear_m_s))

    def off(self) -> tuple[float, float]:
        pose = self.truth.world_from_base
        off_rad = abs(math.remainder(pose.heading_rad - GOAL["heading_rad"], math.tau))
        return math.dist((pose.x_m, pose.y_m), (GOAL["x_m"], GOAL["y_m"])), off_rad

    def begin(self, **goal: float) -> "asyncio.Task[str]":
        self.leg = asyncio.create_task(self.client.navigate_to(**(goal or GOAL)))
        return self.leg

    async def until_driving(self) -> None:
        async with asyncio.timeout(10.0):
            while self.speed_m_s < 0.12:  # noqa: ASYNC110 - the truth has no event
                await asyncio.sleep(0.05)


UNCHANGED: Mapping[str, object] = MappingProxyType({})


def in_flat(
    folder: Path,
    scenario: Callable[[Drive], Awaitable[None]],
    zones: str = "",
    before: Callable[[SimulatedRobot], None] = lambda robot: None,
    overrides: Mapping[str, object] = UNCHANGED,
    worker_late_s: float = 0.0,
    grid: OccupancyGrid | None = None,
) -> None:
    """Run a scenario with the robot armed and localized, on a map with these zones; with a ``grid``, in that room.

    ``before`` is called with the robot before it localizes itself; ``overrides`` change its configuration. A worker that
    starts later by a part of its step of 50 ms makes all its steps so much later after the lidar's turns.
    """
    children: list[WorkerInProcess] = []

    async def spawn(theirs: Any, parameters: WorkerParameters) -> Child:
        await asyncio.sleep(worker_late_s)
        children.append(await worker_in_process(theirs, parameters))
        return children[-1]

    async def run() -> None:
        async with localized_robot(
            grid or "flat",
            START,
            folder=folder,
            zones=zones,
            overrides={**AS_BUILT, **overrides},
            spawn_worker=spawn,
            before=before,
        ) as robot:
            drive = Drive(robot, children, folder)
            await asyncio.wait_for(scenario(drive), 120.0 if grid is None else 900.0)
            assert not drive.truth.in_contact

    run_virtual(run())


def drives_in_flat(**options: Any) -> Callable[[Callable[..., Awaitable[None]]], Callable[..., None]]:
    """Make ``async def test_something(drive, ...)`` a test; the options are those of ``in_flat``."""

    def mark(scenario: Callable[..., Awaitable[None]]) -> Callable[..., None]:
        def test(tmp_path: Path, **parameters: Any) -> None:
            in_flat(tmp_path, partial(scenario, **parameters), **options)

        test = wraps(scenario)(test)
        first, *rest = signature(scenario).parameters.values()
        test.__signature__ = Signature([first.replace(name="tmp_path", annotation=Path), *rest])  # type: ignore[attr-defined]
        return test

    return mark
