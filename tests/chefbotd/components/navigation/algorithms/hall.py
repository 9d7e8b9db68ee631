"""A hall of 10 x 8 m that six people cross, each on a route of his own, looking at nothing, while the robot drives.

They walk at 0.5 to 1.1 m/s, so one who comes to a robot that stands walks into it. They are solid: who has touched the
robot stands there, and turns back after a while. What the robot may not do is move when it is touched.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from chefbotd.components.navigation.algorithms.planner import Goal
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, box
from tests.chefbotd.components.navigation.algorithms.drives import RADIUS_M, Drive, Person
from tests.chefbotd.components.navigation.algorithms.grids import rasterised

WIDTH_M, DEPTH_M = 10.0, 8.0
PEOPLE, GOALS, LIMIT_S = 6, 12, 240.0
SCAN_AGE_S = 0.1
FROM_WALL_M, APART_M = 0.7, 2.0
STUNNED_S = 1.5
"""So long somebody stands who has touched the robot, before he turns back."""

TURNS_S = 0.8
"""So long it takes to turn round at the end of a route."""

BESIDE_M = 0.03
"""A touch lasts until he is farther from the robot than this."""

STANDS_M_S = 0.02
"""No faster than this a robot counts as standing."""


@dataclass(slots=True)
class Touch:
    """Somebody touched the robot: when, how fast it drove then, and how fast it drove at him at most while it lasted."""

    stamp_s: float
    speed_m_s: float
    at_him_m_s: float = 0.0

    @property
    def stood(self) -> bool:
        """Whether the robot stood, and did not drive into him afterwards."""
        return max(abs(self.speed_m_s), self.at_him_m_s) <= STANDS_M_S

    def __str__(self) -> str:
        moved = "stood" if self.stood else f"drove {self.speed_m_s:.2f} m/s, {self.at_him_m_s:.2f} m/s at him"
        return f"at {self.stamp_s:.1f} s the robot {moved}"


@dataclass
class Walker(Person):
    """Looks at nothing, and stops only where he touches the robot."""

    touches: bool = False

    def walk(self, dt_s: float, robot: Pose2D) -> None:
        """One step, unless the robot is there."""
        there = self.along_m + self.direction * self.speed_m_s * dt_s
        if not 0 <= there <= self.length_m:
            self.waited_s += dt_s
            if self.waited_s > TURNS_S:
                self.direction, self.waited_s = -self.direction, 0.0
            return
        before, after = (math.dist(self.at(m), (robot.x_m, robot.y_m)) for m in (self.along_m, there))
        if after < min(before, RADIUS_M + self.radius_m):
            self.touches = True
            self.waited_s += dt_s
            if self.waited_s > STUNNED_S:
                self.direction, self.waited_s = -self.direction, 0.0
            return
        self.touches = self.touches and after < RADIUS_M + self.radius_m + BESIDE_M
        self.along_m = there


@dataclass(frozen=True, slots=True)
class Crossed:
    """What became of the goals; the reasons of those not reached, and every touch."""

    goals: int
    reached: int
    reasons: tuple[str, ...]
    touches: tuple[Touch, ...]
    time_s: float

    @property
    def moved(self) -> tuple[Touch, ...]:
        """The touches in which the robot did not stand."""
        return tuple(touch for touch in self.touches if not touch.stood)


@dataclass
class HallDrive(Drive):
    """A drive among people who do not look, with all touches."""

    touches: list[Touch] = field(default_factory=list)
    open: dict[int, Touch] = field(default_factory=dict)

    def tick(self) -> None:
        """20 ms, and who touches the robot then."""
        super().tick()
        for k, person in enumerate(self.people):
            apart_x, apart_y = np.subtract(person.at(person.along_m), (self.pose.x_m, self.pose.y_m))
            gap_m = math.hypot(apart_x, apart_y) - RADIUS_M - person.radius_m
            if k in self.open and gap_m > BESIDE_M:
                del self.open[k]
            if k not in self.open and (person.touches or gap_m < 0) and gap_m <= BESIDE_M:
                self.open[k] = Touch(self.now_s, self.twist.linear_m_s)
                self.touches.append(self.open[k])
            if k in self.open and gap_m < BESIDE_M:
                towards = (
                    math.cos(self.pose.heading_rad) * apart_x + math.sin(self.pose.heading_rad) * apart_y
                )
                at_him_m_s = self.twist.linear_m_s * towards / math.hypot(apart_x, apart_y)
                self.open[k].at_him_m_s = max(self.open[k].at_him_m_s, at_him_m_s)


def crossed(seed: int, goals: int = GOALS) -> Crossed:
    """Drive to some goals in the hall."""
    chance = np.random.default_rng(5000 + seed)
    walls = box(0, 0, WIDTH_M, DEPTH_M)
    places = [_place(chance)]
    while len(places) <= goals:
        place = _place(chance)
        if math.dist((place.x_m, place.y_m), (places[-1].x_m, places[-1].y_m)) > APART_M:
            places.append(place)
    people = [_person(chance) for _ in range(PEOPLE)]
    for person in people:
        while math.dist(person.at(person.along_m), (places[0].x_m, places[0].y_m)) < 1.0:
            person.along_m += 0.5
    grid = rasterised(walls, WIDTH_M, DEPTH_M)
    drive = HallDrive(grid, walls, places[0], list[Person](people), seed=seed, scan_age_s=SCAN_AGE_S)
    reasons = list[str]()
    for goal in places[1:]:
        drive.navigator.navigate_to((Goal(goal.x_m, goal.y_m, goal.heading_rad),))
        drive.run(LIMIT_S)
        if drive.last.progress.goal is not None:
            drive.navigator.cancel()
            reasons.append(f"nothing in {LIMIT_S:.0f} s: {drive.said[-3:]}")
        elif drive.ended[-1].end is not End.REACHED:
            reasons.append(drive.ended[-1].reason)
    return Crossed(goals, goals - len(reasons), tuple(reasons), tuple(drive.touches), drive.now_s)


def _place(chance: np.random.Generator) -> Pose2D:
    x_m, y_m = (chance.uniform(FROM_WALL_M, most_m - FROM_WALL_M) for most_m in (WIDTH_M, DEPTH_M))
    return Pose2D(float(x_m), float(y_m), float(chance.uniform(-math.pi, math.pi)))


def _person(chance: np.random.Generator) -> Walker:
    """Walks to and fro between two opposite walls, by way of a place in between."""
    sides = [[0.4, chance.uniform(0.4, DEPTH_M - 0.4)], [WIDTH_M - 0.4, chance.uniform(0.4, DEPTH_M - 0.4)]]
    if chance.random() < 0.5:
        sides = [
            [chance.uniform(0.4, WIDTH_M - 0.4), 0.4],
            [chance.uniform(0.4, WIDTH_M - 0.4), DEPTH_M - 0.4],
        ]
    between = _place(chance)
    way: Floats = np.array([sides[0], [between.x_m, between.y_m], sides[1]])
    return Walker(way, float(chance.uniform(0.5, 1.1)), is_blind=True, along_m=float(chance.uniform(0, 5)))
