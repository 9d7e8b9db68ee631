"""A simulated robot driven by the navigator: kinematics with delay, a lidar, people, and the true clearance."""

import math
from dataclasses import dataclass, field

import numpy as np

from chefbotd.components.navigation.algorithms.interface import (
    Ended,
    NavigationParameters,
    PoseStatus,
    Seen,
    Step,
)
from chefbotd.components.navigation.algorithms.navigator import Navigator
from chefbotd.components.navigation.algorithms.outline import Footprint, clearance_m
from chefbotd.components.navigation.algorithms.path import Planner
from chefbotd.components.navigation.algorithms.planner import plan
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from tests.chefbotd.components.mapping.algorithms.slam.flat import BEAMS, Floats, cast

STEP_S, CONTROL_EVERY, SCAN_EVERY = 0.02, 2, 5
DELAY_S = 0.1
NOISE_M, MAX_RANGE_M = 0.008, 12.0
MOST_M_S, MOST_RAD_S, ACCELERATION_M_S2, TURN_RAD_S2 = 0.34, 2.0, 1.0, 4.0
RADIUS_M = 0.18
ROUND = NavigationParameters(outline=Footprint(radius_m=RADIUS_M))
BEARINGS = -math.pi + math.tau / BEAMS * np.arange(BEAMS)


@dataclass
class Person:
    """A disc that walks to and fro on its way. Unless blind, it stops before the robot, and turns back after a while."""

    way: Floats
    speed_m_s: float = 0.6
    radius_m: float = 0.22
    is_blind: bool = False
    along_m: float = 0.0
    direction: float = 1.0
    waited_s: float = 0.0

    def __post_init__(self) -> None:
        self._sums = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.way, axis=0).T))])

    @property
    def length_m(self) -> float:
        """Of its way."""
        return float(self._sums[-1])

    def at(self, along_m: float) -> tuple[float, float]:
        """Where it is after so much of its way."""
        return (
            float(np.interp(along_m, self._sums, self.way[:, 0])),
            float(np.interp(along_m, self._sums, self.way[:, 1])),
        )

    def walk(self, dt_s: float, robot: Pose2D) -> None:
        """One step, if nobody is in the way."""
        there = self.along_m + self.direction * self.speed_m_s * dt_s
        if not 0 <= there <= self.length_m:
            self.direction = -self.direction
            return
        x, y = self.at(self.along_m)
        ahead_x, ahead_y = self.at(there)
        apart = math.hypot(robot.x_m - ahead_x, robot.y_m - ahead_y)
        nearer = apart < math.hypot(robot.x_m - x, robot.y_m - y)
        if not self.is_blind and nearer and apart < self.radius_m + RADIUS_M + 0.15:
            self.waited_s += dt_s
            if self.waited_s > 4.0:
                self.direction, self.waited_s = -self.direction, 0.0
            return
        self.along_m = there


@dataclass(frozen=True, slots=True)
class Clearance:
    """Where the robot was, how far its outline was from walls and furniture, and from people, and where these were."""

    x_m: float
    y_m: float
    walls_m: float
    people_m: float
    people: tuple[tuple[float, float], ...] = ()
    speed_m_s: float = 0.0


@dataclass
class Drive:
    """A robot somewhere, and what happened to it: the least clearance, its way, how its goals ended."""

    grid: OccupancyGrid
    walls: Floats
    pose: Pose2D
    people: list[Person] = field(default_factory=list)
    params: NavigationParameters = ROUND
    planner: Planner = plan
    seed: int = 0
    status: PoseStatus = PoseStatus.LOCALIZED
    lidar_works: bool = True
    scan_age_s: float = 0.0
    """So long after its time a scan is told of."""
    silent_s: tuple[float, float] = (math.inf, math.inf)
    """From then until then no reading comes, and no command is obeyed: the classic board waits for an echo."""

    def __post_init__(self) -> None:
        self.scans: list[tuple[float, Seen]] = []
        self._read = 0.0, self.pose, Twist2D()
        self.navigator = Navigator(self.params, self.planner)
        self.navigator.use_map(self.grid)
        self.chance = np.random.default_rng(self.seed)
        self.now_s, self.ticks = 0.0, 0
        self.twist = Twist2D()
        self.queue: list[tuple[float, Twist2D]] = []
        self.asked = Twist2D()
        self.way_m, self.least_m = 0.0, math.inf
        self.passed: list[Clearance] = []
        self.ended: list[Ended] = []
        self.said: list[str] = []
        self.twists: list[Twist2D] = []
        self.last: Step | None = None

    def walls_m(self) -> float:
        """From the outline to the nearest wall or piece of furniture; negative is a touch."""
        hull, pad_m = self.params.outline.hull, self.params.outline.pad_m
        cos, sin = math.cos(self.pose.heading_rad), math.sin(self.pose.heading_rad)
        nearest = math.inf
        ax, ay, bx, by = self.walls.T
        if len(hull) == 1:
            ex, ey = bx - ax, by - ay
            share = ((self.pose.x_m - ax) * ex + (self.pose.y_m - ay) * ey) / np.maximum(
                ex * ex + ey * ey, 1e-12
            )
            share = np.clip(share, 0, 1)
            nearest = (
                float(np.hypot(self.pose.x_m - ax - share * ex, self.pose.y_m - ay - share * ey).min())
                - pad_m
            )
        else:
            for s in np.linspace(0, 1, 60):
                dx, dy = ax + s * (bx - ax) - self.pose.x_m, ay + s * (by - ay) - self.pose.y_m
                close = np.hypot(dx, dy) < 1.0
                for x, y in zip(dx[close], dy[close], strict=True):
                    nearest = min(nearest, clearance_m(hull, pad_m, cos * x + sin * y, cos * y - sin * x))
        return nearest

    def people_m(self) -> float:
        """From the outline to the nearest person; negative is a touch."""
        hull, pad_m = self.params.outline.hull, self.params.outline.pad_m
        cos, sin = math.cos(self.pose.heading_rad), math.sin(self.pose.heading_rad)
        nearest = math.inf
        for person in self.people:
            x, y = person.at(person.along_m)
            dx, dy = x - self.pose.x_m, y - self.pose.y_m
            apart = clearance_m(hull, pad_m, cos * dx + sin * dy, cos * dy - sin * dx) - person.radius_m
            nearest = min(nearest, apart)
        return nearest

    def tick(self) -> None:
        """20 ms of the world; a scan every 100 ms, a step of the navigator every 40 ms."""
        if self.ticks % SCAN_EVERY == 0 and self.lidar_works:
            self.scans.append((self.now_s + self.scan_age_s, self._scan()))
        while self.scans and self.scans[0][0] <= self.now_s + 1e-9:
            self.navigator.take_scan(self.scans.pop(0)[1])
        if self.ticks % CONTROL_EVERY == 0:
            step = self.navigator.step(self.now_s, self._measured(), self.status, self.now_s - self._read[0])
            self.asked = step.twist or Twist2D()
            self.twists.append(self.asked)
            self.ended += step.ended
            if not self.said or step.progress.reason != self.said[-1]:
                self.said.append(step.progress.reason)
            self.last = step
            self.queue.append((self.now_s + DELAY_S, self.asked))
        self._move()
        for person in self.people:
            person.walk(STEP_S, self.pose)
        self.ticks += 1
        self.now_s = self.ticks * STEP_S
        if self.ticks % 2 == 0:
            people = tuple(person.at(person.along_m) for person in self.people)
            here = self.pose.x_m, self.pose.y_m
            clearance = Clearance(*here, self.walls_m(), self.people_m(), people, self.twist.linear_m_s)
            self.passed.append(clearance)
            self.least_m = min(self.least_m, clearance.walls_m, clearance.people_m)

    def run(self, until_s: float) -> None:
        """Until all goals have ended, or so much later."""
        begin = len(self.ended)
        limit_s = self.now_s + until_s
        while self.now_s < limit_s:
            self.tick()
            if len(self.ended) > begin and self.last.progress.goal is None:
                break

    def _scan(self) -> Seen:
        people = np.array([(*p.at(p.along_m), p.radius_m) for p in self.people]).reshape(-1, 3)
        pose = np.array([self.pose.x_m, self.pose.y_m, self.pose.heading_rad])
        ranges = cast(self.walls, pose, people, BEARINGS) + self.chance.normal(0, NOISE_M, BEAMS)
        good = (ranges < MAX_RANGE_M) & (self.chance.random(BEAMS) > 0.02)
        points = np.stack([np.cos(BEARINGS), np.sin(BEARINGS)], axis=1)[good] * ranges[good, None]
        return Seen(self.now_s, self._measured(), np.zeros(2), points)

    @property
    def is_silent(self) -> bool:
        """Whether the board waits for an echo."""
        return self.silent_s[0] <= self.now_s < self.silent_s[1]

    def _measured(self) -> Pose2D:
        if not self.is_silent:
            self._read = self.now_s, self.pose, self.twist
        began_s, pose, twist = self._read
        turned, moved = (
            (self.now_s - began_s) * twist.angular_rad_s,
            (self.now_s - began_s) * twist.linear_m_s,
        )
        here = pose.compose(Pose2D(moved * math.cos(turned / 2), moved * math.sin(turned / 2), turned))
        x, y, heading = self.chance.normal(0, (0.004, 0.004, 0.002))
        return Pose2D(here.x_m + x, here.y_m + y, here.heading_rad + heading)

    def allowed(self, wanted: Twist2D) -> Twist2D:
        """What the obstacle guards let through: here there are none."""
        return wanted

    def _move(self) -> None:
        while self.queue and self.queue[0][0] <= self.now_s:
            obeyed = self.queue.pop(0)[1]
            self._obeyed = getattr(self, "_obeyed", Twist2D()) if self.is_silent else obeyed
        wanted = self.allowed(getattr(self, "_obeyed", Twist2D()))
        linear = _towards(self.twist.linear_m_s, wanted.linear_m_s, ACCELERATION_M_S2 * STEP_S, MOST_M_S)
        angular = _towards(self.twist.angular_rad_s, wanted.angular_rad_s, TURN_RAD_S2 * STEP_S, MOST_RAD_S)
        self.twist = Twist2D(linear, angular)
        turned, moved = angular * STEP_S, linear * STEP_S
        self.way_m += abs(moved)
        self.pose = self.pose.compose(
            Pose2D(moved * math.cos(turned / 2), moved * math.sin(turned / 2), turned)
        )


def _towards(now: float, wanted: float, change: float, most: float) -> float:
    wanted = min(max(wanted, -most), most)
    return now + min(max(wanted - now, -change), change)
