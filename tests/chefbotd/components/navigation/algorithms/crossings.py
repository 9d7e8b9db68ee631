"""Somebody who looks at nothing crosses the robot's way: how near he comes, and whether a robot that brakes is touched.

He walks straight on, whatever is in his way. So a touch counts as the robot's own only if a robot that had braked at
once, at some time in the three seconds before, would not have been touched. Nobody knows that the board will fall
silent: where it did, braking is tried after it only.
"""

import math
from dataclasses import dataclass

import numpy as np

from chefbotd.components.navigation.algorithms.path import Goal
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, box, wall
from tests.chefbotd.components.navigation.algorithms.drives import RADIUS_M, ROUND, Drive, Person
from tests.chefbotd.components.navigation.algorithms.grids import rasterised

SCAN_AGE_S = 0.1
BEFORE_S, LATEST_S = 3.0, 0.3
"""So long before a touch, and so shortly before, braking at once is tried."""

AT_GOAL_S = 1.0
"""A robot that has reached its goal so long ago stands there, and who walks into it walks into it."""


@dataclass(frozen=True)
class Scene:
    """Walls on the map, where the robot drives from and to, and where its way is crossed."""

    name: str
    walls: Floats
    width_m: float
    depth_m: float
    start: Pose2D
    goal: Goal
    crossed_m: tuple[float, float]
    heading_rad: float
    after_m: float
    """So much of its way the robot has driven when it is there."""


OPEN = Scene(
    "hall", box(0, 0, 7.0, 8.0), 7.0, 8.0, Pose2D(0.8, 3.9, 0.1), Goal(6.2, 4.1, 0.0), (3.4, 4.0), 0.04, 2.6
)
DOOR = np.vstack([box(0, 0, 9.0, 4.3), wall((0, 3.0), (3.0, 3.0)), wall((3.9, 3.0), (9.0, 3.0))])
INTO = Scene(
    "door", DOOR, 9.0, 4.3, Pose2D(3.35, 1.3, 1.5), Goal(3.6, 3.7, 0.4), (3.5, 3.65), math.pi / 2, 2.35
)  # its goal is in the corridor, where people walk


@dataclass(frozen=True)
class Crossing:
    """Somebody on a straight way: at ``angle_rad`` to the robot's, ``late_s`` after the robot would be there."""

    scene: Scene
    angle_rad: float
    speed_m_s: float
    late_s: float
    phase_s: float = 0.0
    silent_s: tuple[float, float] = (math.inf, math.inf)


@dataclass
class Walker(Person):
    """Walks on from his start from a time on."""

    starts_s: float = 0.0
    now_s: float = 0.0

    def walk(self, dt_s: float, robot: Pose2D) -> None:
        """One step, whatever is in the way."""
        self.now_s += dt_s
        if self.now_s > self.starts_s:
            self.along_m += self.speed_m_s * dt_s


@dataclass(frozen=True)
class Meeting:
    """The least distance; whether he was touched, also while the robot drove, and whether that was the robot's own."""

    least_m: float
    touched: bool
    drove: bool
    own: bool
    reached: bool
    time_s: float


def met(crossing: Crossing, limit_s: float = 40.0) -> Meeting:
    """Let them meet."""
    scene = crossing.scene
    x_m, y_m = scene.crossed_m
    heading = scene.heading_rad + crossing.angle_rad
    back_m = _free_m(scene, heading + math.pi)
    along = np.array([math.cos(heading), math.sin(heading)])
    way = np.array([x_m, y_m]) + np.array([-back_m, 20.0])[:, None] * along
    there_s = scene.after_m / ROUND.follower.max_speed_m_s + 1.0 + crossing.late_s + crossing.phase_s
    starts_s = there_s - back_m / crossing.speed_m_s
    person = Walker(way, crossing.speed_m_s, radius_m=0.25, is_blind=True, starts_s=starts_s)
    person.along_m = max(-starts_s, 0.0) * crossing.speed_m_s
    drive = Drive(
        rasterised(scene.walls, scene.width_m, scene.depth_m), scene.walls, scene.start, [person],
        scan_age_s=SCAN_AGE_S, silent_s=crossing.silent_s,
    )  # fmt: skip
    drive.navigator.navigate_to((scene.goal,))
    poses, places, speeds, ended_s = [], [], [], math.inf
    while drive.now_s < limit_s and not (drive.ended and drive.now_s > there_s + 4.0):
        drive.tick()
        poses.append(drive.pose)
        places.append(person.at(person.along_m))
        speeds.append(drive.twist.linear_m_s)
        if drive.ended and ended_s == math.inf:
            ended_s = drive.now_s
    here, people = np.array([(p.x_m, p.y_m) for p in poses]), np.array(places)
    apart = np.hypot(*(here - people).T) - RADIUS_M - person.radius_m
    touches = np.flatnonzero(apart < 0)
    reached = bool(drive.ended) and drive.ended[-1].end == "reached"
    if not len(touches):
        return Meeting(float(apart.min()), False, False, False, reached, drive.now_s)
    first, last = int(touches[0]), int(touches[-1])
    drove = bool(np.abs(speeds[first : first + 5]).max() > 0.02)
    is_over = bool(drive.ended) and ended_s < first * 0.02 - AT_GOAL_S
    own = not is_over and _is_own(poses, speeds, people, first, last, person.radius_m, drive.silent_s)
    return Meeting(float(apart.min()), True, drove, own, reached, drive.now_s)


def _free_m(scene: Scene, heading: float) -> float:
    """How far it is to a wall, less the person's radius and a little."""
    x_m, y_m = scene.crossed_m
    for along_m in np.arange(0.5, 4.5, 0.1):
        x, y = x_m + along_m * math.cos(heading), y_m + along_m * math.sin(heading)
        ax, ay, bx, by = scene.walls.T
        share = np.clip(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / np.hypot(bx - ax, by - ay) ** 2, 0, 1)
        if np.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay)).min() < 0.4:
            return float(along_m - 0.1)
    return 4.5


def _is_own(
    poses: list[Pose2D],
    speeds: list[float],
    people: Floats,
    first: int,
    last: int,
    radius_m: float,
    silent_s: tuple[float, float],
) -> bool:
    """Whether a robot that had braked would not have been touched by all of his way."""
    stands = list[Pose2D]()
    begin = math.ceil(silent_s[1] / 0.02) if silent_s[0] < 0.02 * first else 0
    for before_s in np.arange(LATEST_S, BEFORE_S + 0.01, 0.1):
        k = first - round(before_s / 0.02)
        if k >= begin:
            speed = speeds[k]
            on_m = speed * 0.15 + math.copysign(speed**2 / (2 * ROUND.follower.deceleration_m_s2), speed)
            stands.append(poses[k].compose(Pose2D(on_m, 0.0, 0.0)))
    after = people[max(first - 150, 0) : last + 1]
    return any(
        np.hypot(after[:, 0] - s.x_m, after[:, 1] - s.y_m).min() - RADIUS_M - radius_m > 0 for s in stands
    )
