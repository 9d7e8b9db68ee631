"""Goals in five simulated buildings, with chairs that are not on the map, and people who walk about.

The robot is ChefBot's: 0.18 m round, 0.34 m/s at the rim, 0.1 s of delay. Scans of 270 beams, 10 a second, with noise;
the pose is the true one with the noise of a good localization. What can be reached, and the shortest way, is found on
a grid of 2.5 cm with every wall and chair in it.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy import ndimage

from benchmarks.figures import Figure, Outcome, percentile
from benchmarks.roominess import ROOM_M, least_with_room_m
from chefbotd.components.navigation.algorithms.grid import Flags, Singles, distances_m
from chefbotd.components.navigation.algorithms.path import Goal
from chefbotd.components.navigation.algorithms.search import search
from chefbotd.components.navigation.algorithms.smooth import straighten_path
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.core.geometry import Pose2D, wrap_angle
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, box
from tests.chefbotd.components.navigation.algorithms.buildings import BUILDINGS, Building
from tests.chefbotd.components.navigation.algorithms.drives import RADIUS_M, ROUND, Drive, Person
from tests.chefbotd.components.navigation.algorithms.grids import rasterised
from tests.chefbotd.components.navigation.algorithms.hall import crossed

SEEDS, GOALS, QUICK_GOALS, UNREACHABLE = 3, 20, 4, 3
FINE_M, SURE_M, UNMAPPED_SURE_M, WIDE_M = 0.025, 0.05, 0.09, 0.28
"""A goal counts as reachable where a way has 5 cm on either side, and 9 cm beside what is on no map."""

LENGTH_RATIO, TIME_RATIO, POSITION_M, HEADING_DEG, LIMIT_S = 1.08, 1.35, 0.03, 3.0, 180.0
STANDS_M_S = 0.02
CLASSIC = "move_base: 7 of 8"


@dataclass
class Tally:
    """What happened in a building, over all goals."""

    reachable: int = 0
    reached: int = 0
    unreachable: int = 0
    told: int = 0
    touches: int = 0
    least_m: list[float] = field(default_factory=list)
    people_m: list[float] = field(default_factory=list)
    with_room_m: list[float] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    off_m: list[float] = field(default_factory=list)
    off_deg: list[float] = field(default_factory=list)
    told_wrong: list[str] = field(default_factory=list)
    core: list[float] = field(default_factory=list)


class World:
    """A building with chairs that are on no map, and what is true about it."""

    def __init__(self, building: Building, seed: int, *, chairs: int = 3) -> None:
        self.building, self.chance = building, np.random.default_rng(1000 * seed + 7)
        self.grid = rasterised(building.walls, building.width_m, building.depth_m)
        self.walls = building.walls
        self._map_m = self.room_m = self._distances_m(building.walls)
        self.chairs_m = np.full(self.room_m.shape, np.inf)
        self.main = self._main()
        home = np.count_nonzero(self.main)
        for _ in range(100):
            x, y = (
                self.chance.uniform(0.5, building.width_m - 0.9),
                self.chance.uniform(0.5, building.depth_m - 0.9),
            )
            chair = box(x, y, 0.38, 0.38, self.chance.uniform(0, 1.5))
            if chairs and self._is_placed(chair, home):
                chairs -= 1
        possible, _ = ndimage.label(self._map_m > RADIUS_M - SURE_M)
        self.never = possible != possible[tuple(np.argwhere(self.main)[0])]

    def _is_placed(self, chair: Floats, home: int) -> bool:
        """Put a chair where it is in the way, and closes nothing."""
        before = self.walls, self.room_m, self.chairs_m, self.main
        near_m = self._distances_m(chair)
        self.walls = np.vstack([self.walls, chair])
        self.room_m, self.chairs_m = np.minimum(self.room_m, near_m), np.minimum(self.chairs_m, near_m)
        self.main = self._main()
        if 0.93 < np.count_nonzero(self.main) / home < 0.999:
            return True
        self.walls, self.room_m, self.chairs_m, self.main = before
        return False

    def _distances_m(self, walls: Floats) -> Singles:
        fine = rasterised(walls, self.building.width_m, self.building.depth_m, FINE_M)
        return distances_m(fine.percent > 0, FINE_M)

    def _main(self) -> Flags:
        wide = (self.room_m > RADIUS_M + SURE_M) & (self.chairs_m > RADIUS_M + UNMAPPED_SURE_M)
        parts, _ = ndimage.label(wide)
        return np.asarray(parts == np.argmax(np.bincount(parts.ravel())[1:]) + 1)

    def place(self, where: np.ndarray) -> Pose2D:
        """A random pose in some of the cells."""
        cells = np.argwhere(where)
        row, column = cells[self.chance.integers(len(cells))]
        return Pose2D(
            (column + 0.5) * FINE_M, (row + 0.5) * FINE_M, float(self.chance.uniform(-math.pi, math.pi))
        )

    def shortest_m(self, start: Pose2D, goal: Pose2D) -> float:
        """The shortest way for the robot's circle, in metres."""
        costs = np.where(self.room_m > RADIUS_M, 1, np.inf).astype(np.float32)
        cells = [(int(p.y_m / FINE_M), int(p.x_m / FINE_M)) for p in (start, goal)]
        costs[cells[0]] = costs[cells[1]] = 1
        found = search(costs, *cells)
        if found is None:
            return math.inf
        return float(np.hypot(*np.diff(straighten_path(found.cells, costs, FINE_M), axis=0).T).sum())

    def person(self) -> Person:
        """Somebody who walks between four places where there is room for both."""
        costs = np.where(self.room_m > WIDE_M, 1, np.inf).astype(np.float32)
        parts, _ = ndimage.label(np.isfinite(costs))
        largest = parts == np.argmax(np.bincount(parts.ravel())[1:]) + 1
        places = [self.place(largest) for _ in range(4)]
        way: list[Floats] = []
        for a, b in pairwise(places):
            found = search(costs, *((int(p.y_m / FINE_M), int(p.x_m / FINE_M)) for p in (a, b)))
            if found is not None:
                way.append(straighten_path(found.cells, costs, FINE_M))
        return Person(np.vstack(way), speed_m_s=float(self.chance.uniform(0.3, 0.7)))


def run(*, quick: bool = False, out: Path | None = None) -> Outcome:
    """All buildings; a touch, or a goal whose end is not the true one, is wrong."""
    figures, faults, total = list[Figure](), list[str](), Tally()
    for build in BUILDINGS:
        tally = Tally()
        for seed in range(1 if quick else SEEDS):
            drive_goals(build(seed), seed, QUICK_GOALS if quick else GOALS, tally, total)
        figures += _figures(build.__name__, tally)
        faults += [f"{build.__name__}: {told}" for told in tally.told_wrong]
    figures += _figures("all", total)
    figures += _hall(quick=quick)
    return Outcome(tuple(figures), faults=tuple(faults))


def _hall(*, quick: bool) -> Iterator[Figure]:
    """A hall that six people cross who look at nothing."""
    found = [crossed(seed, QUICK_GOALS) if quick else crossed(seed) for seed in range(1 if quick else SEEDS)]
    goals, reached = sum(each.goals for each in found), sum(each.reached for each in found)
    moved, touches = sum(len(each.moved) for each in found), sum(len(each.touches) for each in found)
    yield Figure(f"hall with six people who do not look, not reached of {goals}", goals - reached, "", 0)
    yield Figure("hall, touches in which the robot moved", moved, "", 0)
    yield Figure("hall, people who walked into the standing robot", touches - moved, "")


def drive_goals(building: Building, seed: int, count: int, *tallies: Tally) -> None:
    """Send the robot from goal to goal."""
    world = World(building, seed)
    people = [world.person() for _ in range(2)]
    start = world.place(world.main)
    drive = Drive(world.grid, world.walls, start, people, seed=seed)
    _keep_apart(drive)
    for k in range(count):
        never = count >= GOALS and k % (count // UNREACHABLE) == 4
        goal = world.place(world.never if never else world.main)
        _one(world, drive, goal, never, f"seed {seed}, goal {k}", tallies)


def _keep_apart(drive: Drive) -> None:
    """Nobody begins inside the robot."""
    for person in drive.people:
        while (
            math.hypot(
                person.at(person.along_m)[0] - drive.pose.x_m, person.at(person.along_m)[1] - drive.pose.y_m
            )
            < 1.0
        ):
            person.along_m += 0.5


def _one(
    world: World, drive: Drive, goal: Pose2D, never: bool, name: str, tallies: tuple[Tally, ...]
) -> None:
    start, way_m, began_s, began_cpu_s = drive.pose, drive.way_m, drive.now_s, time.process_time()
    drive.least_m, drive.said, drive.passed = math.inf, [], []
    drive.navigator.navigate_to((Goal(goal.x_m, goal.y_m, goal.heading_rad),))
    drive.run(LIMIT_S)
    end = drive.ended[-1].end if drive.ended and drive.last.progress.goal is None else None
    told = drive.ended[-1].reason if end else f"nothing: {drive.said[-3:]}"
    spent_s, used_s = drive.now_s - began_s, time.process_time() - began_cpu_s
    with_room_m = least_with_room_m(drive.passed, world.room_m, FINE_M, RADIUS_M)
    for tally in tallies:
        tally.touches += drive.least_m < 0
        tally.least_m.append(drive.least_m)
        tally.people_m.append(min((each.people_m for each in drive.passed), default=math.inf))
        tally.with_room_m.append(with_room_m)
        tally.core.append(used_s / spent_s)
        tally.unreachable += never
        tally.reachable += not never
        tally.told += never and end is End.UNREACHABLE
        tally.reached += not never and end is End.REACHED
        if drive.least_m < 0:
            tally.told_wrong.append(
                f"{name}: touched by {-drive.least_m:.3f} m, {_who_moved(drive)} ({told})"
            )
        if end is not (End.UNREACHABLE if never else End.REACHED):
            tally.told_wrong.append(
                f"{name}: to ({goal.x_m:.2f}, {goal.y_m:.2f}) from ({start.x_m:.2f}, {start.y_m:.2f}): {told}"
            )
        elif not never:
            shortest_m = world.shortest_m(start, goal)
            turns = _turns(start, goal)
            if shortest_m > 1.0:
                tally.lengths.append((drive.way_m - way_m) / shortest_m)
                tally.times.append(
                    spent_s
                    / (shortest_m / ROUND.follower.max_speed_m_s + turns / ROUND.follower.max_turn_rad_s)
                )
            tally.off_m.append(math.hypot(drive.pose.x_m - goal.x_m, drive.pose.y_m - goal.y_m))
            tally.off_deg.append(abs(math.degrees(wrap_angle(drive.pose.heading_rad - goal.heading_rad))))
    if drive.last.progress.goal is not None:
        drive.navigator.cancel()


def _who_moved(drive: Drive) -> str:
    """At the first touch: what was touched, and whether the robot stood or how fast it drove."""
    first = next((each for each in drive.passed if min(each.people_m, each.walls_m) < 0), None)
    if first is None:
        return "between two looks"
    what = "a person" if first.people_m < 0 else "a wall or a chair"
    stood = abs(first.speed_m_s) < STANDS_M_S
    return f"{what}, the robot " + ("stood" if stood else f"drove {first.speed_m_s:.2f} m/s")


def _turns(start: Pose2D, goal: Pose2D) -> float:
    """At least so much turning: to the goal's direction, and there to its heading."""
    bearing = math.atan2(goal.y_m - start.y_m, goal.x_m - start.x_m)
    return abs(wrap_angle(bearing - start.heading_rad)) + abs(wrap_angle(goal.heading_rad - bearing))


def _median(metres: list[float]) -> float:
    """The middle one; of two the smaller."""
    return -percentile([-each for each in metres], 50)


def _figures(name: str, tally: Tally) -> Iterator[Figure]:
    yield Figure(f"{name}, not reached of {tally.reachable}", tally.reachable - tally.reached, "", 0, CLASSIC)
    yield Figure(
        f"{name}, not told of {tally.unreachable} unreachable", tally.unreachable - tally.told, "", 0
    )
    yield Figure(f"{name}, drives with a touch", tally.touches, "", 0)
    if tally.lengths:
        yield Figure(
            f"{name}, way over the shortest, median", percentile(tally.lengths, 50), "x", LENGTH_RATIO
        )
        yield Figure(f"{name}, time over the ideal, median", percentile(tally.times, 50), "x", TIME_RATIO)
    for told, metres in (("all", tally.least_m), ("people", tally.people_m)):
        yield Figure(f"{name}, closest approach to {told}, median of the drives", _median(metres), "m")
        yield Figure(f"{name}, closest approach to {told}, least", min(metres), "m")
    least_m = min(tally.with_room_m)
    yield Figure(f"{name}, closest to walls and furniture where there is room", least_m, "m")
    yield Figure(f"{name}, short of {ROOM_M:.2f} m there by", max(ROOM_M - least_m, 0.0), "m", 0)
    if tally.off_m:
        yield Figure(f"{name}, at the goal off by, worst", max(tally.off_m), "m", POSITION_M)
        yield Figure(f"{name}, turned off by, worst", max(tally.off_deg), "deg", HEADING_DEG)
