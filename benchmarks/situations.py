"""What people report of robots that drive among people and walls, rebuilt: each situation for some seeds.

The robot is that of ``benchmarks.navigation``, with the obstacle guards of the gate.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.figures import Figure, Outcome, percentile
from chefbotd.components.navigation.algorithms.grid import place_points
from chefbotd.components.navigation.algorithms.interface import Seen
from chefbotd.components.navigation.algorithms.path import Goal
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, box, wall
from tests.chefbotd.components.navigation.algorithms.drives import MAX_RANGE_M, RADIUS_M, Person
from tests.chefbotd.components.navigation.algorithms.grids import rasterised
from tests.chefbotd.components.navigation.algorithms.guarded import Guarded

SEEDS, QUICK_SEEDS = 20, 3
DIAMETER_M = 2 * RADIUS_M
EAST = 0.0


@dataclass(frozen=True, slots=True)
class Run:
    """How a goal ended, after what time and way, how much the robot turned, and what came nearest to it."""

    end: End | None
    reason: str
    time_s: float
    way_m: float
    turned_rad: float
    least_m: float
    said: tuple[str, ...] = ()

    @property
    def is_reached(self) -> bool:
        """Whether the robot arrived."""
        return self.end is End.REACHED


@dataclass
class Situation(Guarded):
    """A drive in which a share of the lidar's beams ends anywhere, up to its range."""

    random_share: float = 0.0
    turned_rad: float = 0.0
    extra_walls: Floats = field(default_factory=lambda: np.zeros((0, 4)))

    def _move(self) -> None:
        before_rad = self.pose.heading_rad
        super()._move()
        self.turned_rad += abs(math.remainder(self.pose.heading_rad - before_rad, math.tau))

    def _scan(self) -> Seen:
        seen = super()._scan()
        if not self.random_share:
            return seen
        points = seen.points_m.copy()
        wrong = self.chance.random(len(points)) < self.random_share
        away = np.hypot(points[:, 0], points[:, 1])
        points[wrong] *= (self.chance.uniform(0.1, MAX_RANGE_M, int(wrong.sum())) / away[wrong])[:, None]
        return Seen(seen.stamp_s, seen.map_from_base, seen.sensor_m, points)

    def sent(self, goal: Goal, within_s: float) -> Run:
        """Drive there, and tell what happened."""
        began_s, way_m = self.now_s, self.way_m
        self.least_m, self.turned_rad = math.inf, 0.0
        self.navigator.navigate_to((goal,))
        self.run(within_s)
        is_over = self.last is not None and self.last.progress.goal is None
        last = self.ended[-1] if self.ended and is_over else None
        reason = last.reason if last else self.said[-1]
        return Run(
            last.end if last else None,
            reason,
            self.now_s - began_s,
            self.way_m - way_m,
            self.turned_rad,
            self.least_m,
            tuple(self.said),
        )


class Follower(Person):
    """Walks after the robot, no nearer than ``behind_m`` from outline to outline."""

    def __init__(self, place: tuple[float, float], behind_m: float, speed_m_s: float) -> None:
        super().__init__(np.array([place, place]), speed_m_s, 0.2, is_blind=True)
        self.place, self.behind_m = place, behind_m

    def at(self, along_m: float) -> tuple[float, float]:
        """Where it is now."""
        return self.place

    def walk(self, dt_s: float, robot: Pose2D) -> None:
        """One step after the robot."""
        dx, dy = robot.x_m - self.place[0], robot.y_m - self.place[1]
        apart_m = math.hypot(dx, dy)
        step_m = min(self.speed_m_s * dt_s, apart_m - RADIUS_M - self.radius_m - self.behind_m)
        if step_m > 0:
            self.place = self.place[0] + step_m * dx / apart_m, self.place[1] + step_m * dy / apart_m


def followed(seed: int, behind_m: float = 0.35, speed_m_s: float = 0.3) -> Run:
    """5 m through a hall, with somebody right behind."""
    chance = np.random.default_rng(seed)
    y_m = 2.0 + float(chance.uniform(-0.3, 0.3))
    start, walls = Pose2D(1.5, y_m, float(chance.uniform(-0.2, 0.2))), box(0, 0, 9.0, 4.0)
    behind = Follower((1.5 - RADIUS_M - 0.2 - behind_m, y_m), behind_m, speed_m_s)
    drive = Situation(rasterised(walls, 9.0, 4.0), walls, start, [behind], seed=seed, has_sonar=False)
    return drive.sent(Goal(6.5, 2.0, float(chance.uniform(-3, 3))), 90.0)


def renewed(seed: int, per_s: float) -> float:
    """How far the robot comes in 8 s towards a goal that is sent so often, and drifts by a centimetre each time."""
    chance = np.random.default_rng(seed)
    walls = box(0, 0, 9.0, 4.0)
    start = Pose2D(1.5, 2.0, float(chance.uniform(-0.3, 0.3)))
    drive = Situation(rasterised(walls, 9.0, 4.0), walls, start, seed=seed, has_sonar=False)
    count = 0
    while drive.now_s < 8.0:
        if drive.now_s >= count / per_s if per_s else not count:
            drive.navigator.navigate_to((Goal(6.5 + 0.01 * (count % 2), 2.0, 0.0),))
            count += 1
        drive.tick()
    return math.dist((drive.pose.x_m, drive.pose.y_m), (start.x_m, start.y_m))


def squeezed(
    seed: int, wider_m: float, *, is_door: bool = False, turned_rad: float = 0.0, within_s: float = 90.0
) -> Run:
    """Through a corridor of 2 m, or a door, so much wider than the robot; its walls are anywhere in the map's cells.

    The whole room is turned by an angle.
    """
    chance = np.random.default_rng(seed)
    half_m = (DIAMETER_M + wider_m) / 2
    y_m = 1.5 + float(chance.uniform(0, 0.05))
    begin_m, end_m = (2.0, 2.1) if is_door else (2.0, 4.0)
    parts = [box(0, 0, 6.0, 3.0)]
    for side in (-1, 1):
        at_m = y_m + side * half_m
        far_m = 0.0 if side < 0 else 3.0
        parts += [wall((begin_m, far_m), (begin_m, at_m), (end_m, at_m), (end_m, far_m))]
    start = Pose2D(1.0, y_m + float(chance.uniform(-0.3, 0.3)), float(chance.uniform(-0.5, 0.5)))
    end = Pose2D(5.0, 1.5) if is_door or seed % 2 else Pose2D(3.0, y_m)
    cos, sin = abs(math.cos(turned_rad)), abs(math.sin(turned_rad))
    width_m, depth_m = 6.0 * cos + 3.0 * sin, 6.0 * sin + 3.0 * cos
    corner = Pose2D(-3.0, -1.5)
    turn = Pose2D(width_m / 2, depth_m / 2, turned_rad).compose(corner)
    walls = np.vstack(parts)
    walls = np.hstack([place_points(turn, walls[:, :2]), place_points(turn, walls[:, 2:])])
    start, end = turn.compose(start), turn.compose(end)
    grid = rasterised(walls, width_m + 0.1, depth_m + 0.1)
    drive = Situation(grid, walls, start, seed=seed, has_sonar=False)
    return drive.sent(Goal(end.x_m, end.y_m, end.heading_rad), within_s)


def beside_wall(seed: int, apart_m: float, heading_rad: float) -> Run:
    """To a goal that leaves so little to a wall."""
    chance = np.random.default_rng(seed)
    walls = box(0, 0, 4.0, 3.0)
    start = Pose2D(2.0 + float(chance.uniform(-0.5, 0.5)), 1.2, math.pi / 2)
    drive = Situation(rasterised(walls, 4.0, 3.0), walls, start, seed=seed, has_sonar=seed % 2 == 0)
    return drive.sent(Goal(2.0, 3.0 - RADIUS_M - apart_m, heading_rad), 120.0)


def noisy(seed: int, share: float) -> Run:
    """5 m through a hall, with a share of the lidar's beams at random."""
    walls = box(0, 0, 9.0, 4.0)
    drive = Situation(
        rasterised(walls, 9.0, 4.0), walls, Pose2D(1.5, 2.0), seed=seed, random_share=share, has_sonar=False
    )
    return drive.sent(Goal(6.5, 2.0, 0.0), 120.0)


def run(*, quick: bool = False) -> Outcome:
    """Each situation for 20 seeds."""
    seeds = QUICK_SEEDS if quick else SEEDS
    return Outcome((*_of_people(seeds), *_of_walls(seeds), *_of_noise(seeds)))


def _of_people(seeds: int) -> Iterator[Figure]:
    for behind_m in (0.35, 0.8):
        runs = [followed(seed, behind_m) for seed in range(seeds)]
        yield from _of_runs(f"followed at {behind_m} m", runs)
        yield Figure(
            f"followed at {behind_m} m, longest way for 5 m", max(each.way_m for each in runs), "m", 5.5
        )
    one_m = renewed(0, 0.0)
    for per_s in (1.0, 4.0, 10.0):
        yield Figure(
            f"goal renewed {per_s:.0f} times a second, share of the way lost",
            1 - renewed(0, per_s) / one_m,
            "",
            0.1,
        )


def _of_walls(seeds: int) -> Iterator[Figure]:
    for is_door, name in ((False, "corridor"), (True, "door")):
        for wider_m in (0.06, 0.09, 0.14):
            runs = [squeezed(seed, wider_m, is_door=is_door) for seed in range(seeds)]
            yield from _of_runs(f"{name} {100 * wider_m:.0f} cm wider", runs)
        told = [squeezed(seed, 0.02, is_door=is_door) for seed in range(seeds)]
        yield Figure(
            f"{name} 2 cm wider, time until it ends, longest", max(each.time_s for each in told), "s"
        )
    beside = [beside_wall(seed, 0.03, 0.0) for seed in range(seeds)]
    yield Figure(
        "goal 3 cm before a wall, time until it ends, longest", max(each.time_s for each in beside), "s", 5
    )


def _of_noise(seeds: int) -> Iterator[Figure]:
    for share in (0.0, 0.01, 0.03, 0.1):
        yield from _of_runs(
            f"{share:.0%} of the beams at random", [noisy(seed, share) for seed in range(seeds)]
        )


def _of_runs(name: str, runs: Sequence[Run]) -> Iterator[Figure]:
    yield Figure(f"{name}, not reached of {len(runs)}", sum(not each.is_reached for each in runs), "", 0)
    yield Figure(f"{name}, time, median", percentile([each.time_s for each in runs], 50), "s")
    yield Figure(f"{name}, closest approach, least", min(each.least_m for each in runs), "m")
