"""Drives healthy robots at random where echoes come and go: ``python -m tests.scenarios.healthy_drives N``.

Each of the N drives begins with a seed of its own, which draws the robot as it was built and loaded, the sketch on its
board, the hall (silent, with an echo now and then, or in blocks of both), and how it is driven: by hand, in ramps, to
and fro, or to goals on a map. Prints every fault, of which a healthy robot has none, and exits with 1 if there was one.
A wheel that is driven and really stands, as the simulation knows, is counted apart.
"""

import argparse
import asyncio
import logging
import math
import multiprocessing
import random
import sys
import tempfile
from collections import deque
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import structlog

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.components.maps.algorithms.map_server import to_description, to_image
from chefbotd.components.simulation.parameters.sketches import PUBLISHED_SKETCHES
from chefbotd.core.events import DriveWarned, SafetyChanged
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from chefbotd.core.record import Record
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from chefbotd.testing.on_map import localized_robot
from tests.scenarios.robots import AS_BUILT, AS_CONFIGURED, settings_of

PERIOD_S = 0.05
SKETCHES = tuple(f"chefbot/{sketch.value}" for sketch in PUBLISHED_SKETCHES)
ROBOTS = ("chefbot/tiva", "chefbot/tiva", *SKETCHES, "chefbot/chefbot", "khan")
"""The first sketch thrice: of the published ones it and the Duemilanove's wait for echoes."""

LINEAR_M_S, ANGULAR_RAD_S = 0.4, 2.0
LOADS = (0.5, 0.93, 1.5)
"""Shares of the mass that the robot is configured with: three times as heavy, KHAN's wheels really stall in a turn."""

DRIVES_A_ROBOT, GOALS_A_ROBOT = 20, 5
NAVIGATED_SHARE = 0.1
"""Of the robots, those that are sent to goals."""

SIDE_M, CELL_M = 40.0, 0.2
WHEELS = {
    "chefbot": ("left_wheel", "right_wheel"),
    "khan": ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"),
}
STALL_S, STOOD_RAD = 1.5, 0.15
"""A wheel that turned less in so long before the last ``UNSEEN_S``, and is driven, is stalled; at a half of its duty it
is a fault after 1.75 s, and the earlier the harder it is driven."""

UNSEEN_S = 0.1
"""So long a motion may last until its reading has been judged."""

GOAL_S = 40.0
"""A goal is given up after so long: in a silent hall a robot crawls."""


class Hall:
    """Echoes that are lost at random: always, in a share of the cycles, or in blocks of up to ten seconds."""

    def __init__(self, chance: random.Random) -> None:
        self._chance = chance
        self.kind = chance.choice(("silent", "cycles", "blocks"))
        self._share = chance.uniform(0.1, 0.9)
        self._until_s = 0.0

    def step(self, robot: SimulatedRobot, now_s: float) -> None:
        """Decide whether the next echo comes."""
        if now_s < self._until_s:
            return
        self._until_s = now_s + (self._chance.uniform(0.2, 10.0) if self.kind == "blocks" else PERIOD_S)
        robot.board.lose_echoes(self.kind == "silent" or self._chance.random() < self._share)


def open_hall(folder: Path, side_m: float = SIDE_M, cell_m: float = CELL_M) -> Path:
    """A square hall, in the middle of which the robot stands."""
    cells = round(side_m / cell_m)
    percent = np.full((cells, cells), FREE, np.int8)
    percent[0] = percent[-1] = percent[:, 0] = percent[:, -1] = OCCUPIED
    grid = OccupancyGrid(cell_m, Pose2D(-side_m / 2, -side_m / 2), percent)
    (folder / "hall.pgm").write_bytes(to_image(grid))
    (folder / "hall.yaml").write_text(to_description(grid, "hall.pgm"))
    return folder / "hall.yaml"


def room() -> OccupancyGrid:
    """14 by 10 m, with things at its walls that tell the directions apart."""
    cell_m = 0.05
    percent = np.full((round(10 / cell_m), round(14 / cell_m)), FREE, np.int8)
    percent[0] = percent[-1] = percent[:, 0] = percent[:, -1] = OCCUPIED
    for x_m, y_m, width_m, depth_m in ((0, 0, 1.5, 1.0), (13.0, 7.0, 1.0, 2.5), (4.0, 9.4, 1.5, 0.6)):
        row, column = round(y_m / cell_m), round(x_m / cell_m)
        percent[row : row + round(depth_m / cell_m), column : column + round(width_m / cell_m)] = OCCUPIED
    return OccupancyGrid(cell_m, Pose2D(), percent)


def speeds(chance: random.Random, seconds: float) -> list[tuple[float, float]]:
    """What is asked for, every 50 ms: a constant twist, a ramp between two, or one to and fro."""
    count = round(seconds / PERIOD_S)
    slow = chance.choice((0.15, 1.0, 1.0))
    first, second = [
        (slow * chance.uniform(-LINEAR_M_S, LINEAR_M_S), slow * chance.uniform(-ANGULAR_RAD_S, ANGULAR_RAD_S))
        for _ in range(2)
    ]
    kind = chance.choice(("constant", "ramp", "to and fro"))
    if kind == "constant":
        return [first] * count
    if kind == "ramp":
        shares = [i / count for i in range(count)]
        return [
            (first[0] + share * (second[0] - first[0]), first[1] + share * (second[1] - first[1]))
            for share in shares
        ]
    half = chance.choice((4, 10, 30))
    return [first if i // half % 2 == 0 else (-first[0], -first[1]) for i in range(count)]


async def drive_by_hand(robot: SimulatedRobot, chance: random.Random, hall: Hall) -> None:
    """A few legs, each with a pause, a stop, or nothing behind it."""
    loop = asyncio.get_running_loop()
    for _ in range(chance.randint(1, 4)):
        for linear_m_s, angular_rad_s in speeds(chance, chance.uniform(0.3, 5.0)):
            hall.step(robot, loop.time())
            await robot.client.drive(linear_m_s, angular_rad_s)
            await asyncio.sleep(PERIOD_S)
        end = chance.choice(("go on", "stop", "fall silent"))
        if end == "stop":
            await robot.client.stop()
        pause_s = chance.uniform(0.0, 3.0) if end != "go on" else 0.0
        for _ in range(round(pause_s / PERIOD_S)):
            hall.step(robot, loop.time())
            await asyncio.sleep(PERIOD_S)


async def drive_to_goal(robot: SimulatedRobot, chance: random.Random, hall: Hall) -> None:
    """To anywhere in the room; how the goal ends is not judged here."""
    loop = asyncio.get_running_loop()
    goal = {"x_m": chance.uniform(2.0, 12.0), "y_m": chance.uniform(2.0, 8.0)}
    leg = asyncio.create_task(robot.client.call("navigate_to", **goal, on_progress=lambda *args: None))
    ends_s = loop.time() + GOAL_S
    while not leg.done() and loop.time() < ends_s:
        hall.step(robot, loop.time())
        await asyncio.sleep(PERIOD_S)
    leg.cancel()
    await asyncio.gather(leg, return_exceptions=True)


class TrueTravel:
    """How far each wheel really turned lately: one that the ground holds is stalled, and that is no false fault."""

    def __init__(self, robot: SimulatedRobot, names: tuple[str, ...]) -> None:
        self._robot, self._names = robot, names
        self._samples: deque[tuple[float, ...]] = deque(maxlen=round((STALL_S + UNSEEN_S) / PERIOD_S))

    async def watch(self) -> None:
        """Look every 50 ms until cancelled."""
        while True:
            self._samples.append(self._robot.board.wheel_speeds_rad_s())
            await asyncio.sleep(PERIOD_S)

    def stood(self, reason: str) -> bool:
        """Whether a wheel that is named has hardly turned."""
        judged = list(self._samples)[: round(STALL_S / PERIOD_S)]
        turned_rad = [sum(abs(speed) * PERIOD_S for speed in speeds) for speeds in zip(*judged, strict=True)]
        return any(
            name in reason and rad < STOOD_RAD for name, rad in zip(self._names, turned_rad, strict=True)
        )


async def accused(
    robot: SimulatedRobot, seed: int, hall: Hall, drives: int, *, to_goals: bool, is_khan: bool
) -> tuple[list[str], list[str]]:
    """Drive so often; each false fault and each true stall, with its reason. After either the robot is armed again."""
    found: list[str] = []
    stalls: list[str] = []
    changes = robot.daemon.bus.subscribe(SafetyChanged, size=256)
    warnings = robot.daemon.bus.subscribe(DriveWarned, size=256)
    travel = TrueTravel(robot, WHEELS["khan" if is_khan else "chefbot"])
    watching = asyncio.create_task(travel.watch())
    for number in range(drives):
        chance = random.Random(seed * 1000 + number)
        try:
            await (drive_to_goal if to_goals else drive_by_hand)(robot, chance, hall)
        except CallError:  # after a fault, which is told by the topic
            await asyncio.sleep(0.0)
        faults = [event for event in changes.take_all() if event.fault]
        for event in faults[:1]:
            is_true = event.fault == "wheel_stalled" and travel.stood(event.reason)
            (stalls if is_true else found).append(f"{event.fault}: {event.reason}")
        found += [f"warning: {event.reason}" for event in warnings.take_all() if event.reason]
        if faults:
            await robot.client.call("arm")
    watching.cancel()
    await asyncio.gather(watching, return_exceptions=True)
    return found, stalls


class Driven(Record, frozen=True):
    """How many drives of a robot there were, what was held against it wrongly, and which wheels really stalled."""

    drives: int
    found: list[str]
    stalls: list[str]


def run_robot(seed: int, drives: int = DRIVES_A_ROBOT) -> Driven:
    """Drive the robot of this seed."""
    chance = random.Random(seed)
    name, hall, load = chance.choice(ROBOTS), Hall(chance), chance.choice(LOADS)
    built = chance.choice((AS_BUILT, AS_CONFIGURED))
    mass_kg = round(load * settings_of(name, {}).sim.body.mass_kg, 2)
    overrides = {**built, "sim.seed": seed, "sim.body.mass_kg": mass_kg}
    to_goals = name != "khan" and chance.random() < NAVIGATED_SHARE
    drives = min(drives, GOALS_A_ROBOT) if to_goals else drives

    async def by_hand() -> tuple[list[str], list[str]]:
        with tempfile.TemporaryDirectory() as folder:
            where = {"sim.world.map_path": open_hall(Path(folder))}
            async with simulated_robot(settings_of(name, {**overrides, **where})) as robot:
                await asyncio.sleep(1.5)
                return await accused(robot, seed, hall, drives, to_goals=False, is_khan=name == "khan")

    async def on_map() -> tuple[list[str], list[str]]:
        start = Pose2D(chance.uniform(3, 11), chance.uniform(3, 7), chance.uniform(-math.pi, math.pi))
        board = {"sim.board.sketch": name.partition("/")[2]} if name != "chefbot/chefbot" else {}
        async with localized_robot(room(), start, overrides={**overrides, **board}) as robot:
            return await accused(robot, seed, hall, drives, to_goals=True, is_khan=False)

    how = "goals" if to_goals else "by hand"
    found, stalls = run_virtual(on_map() if to_goals else by_hand())
    who = f"seed {seed}, {name}, {hall.kind}, {mass_kg} kg, {how}"
    return Driven(drives, [f"{who}: {each}" for each in found], [f"{who}: {each}" for each in stalls])


def main() -> int:
    """Drive, print each fault, and say how many there were."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("drives", type=int, help="so many at least")
    parser.add_argument("--seed", type=int, default=0, help="of the first robot")
    parser.add_argument("--jobs", type=int, default=1, help="so many processes")
    arguments = parser.parse_args()
    done, faults, stalled, seed = 0, 0, 0, arguments.seed
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(arguments.jobs, mp_context=context, initializer=be_quiet) as pool:
        while done < arguments.drives:
            seeds = range(seed, seed + 4 * arguments.jobs)
            seed = seeds.stop
            for driven in pool.map(run_robot, seeds):
                done, faults = done + driven.drives, faults + len(driven.found)
                stalled += len(driven.stalls)
                sys.stdout.writelines(each + "\n" for each in driven.found)
                sys.stdout.writelines(f"really stalled: {each}\n" for each in driven.stalls)
            sys.stdout.write(f"{done} drives, {faults} false faults, {stalled} wheels that really stalled\n")
            sys.stdout.flush()
    return 1 if faults else 0


def be_quiet() -> None:
    """No log lines of the robots."""
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.CRITICAL))


if __name__ == "__main__":
    sys.exit(main())
