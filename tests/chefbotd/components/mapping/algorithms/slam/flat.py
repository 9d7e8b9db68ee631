"""A flat of rooms, people in it, and a robot with a lidar and bad odometry: independent of the code under test."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BEAMS, MAX_RANGE_M, NOISE_M, DROPPED = 270, 12.0, 0.01, 0.02
STEP_M, TURN_RAD = 0.1, 0.12


def box(x: float, y: float, width: float, depth: float, turn_rad: float = 0.0) -> Floats:
    """The four sides (x, y, x, y) of a box with its first corner at (x, y), turned about it."""
    corners = np.array([[0, 0], [width, 0], [width, depth], [0, depth], [0, 0]], float)
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    placed = corners @ np.array([[cos, sin], [-sin, cos]]) + [x, y]
    return np.hstack([placed[:-1], placed[1:]])


def wall(*points: tuple[float, float]) -> Floats:
    """A wall from point to point."""
    path = np.array(points, float)
    return np.hstack([path[:-1], path[1:]])


def furnished_flat() -> Floats:
    """Five rooms around a corridor, 10.4 by 8.1 m, no two alike; the doors are 0.9 m wide."""
    return np.vstack(
        [
            box(0, 0, 10.4, 8.1),
            wall((0, 3.2), (1.6, 3.2)),
            wall((2.5, 3.2), (6.3, 3.2)),
            wall((7.2, 3.2), (10.4, 3.2)),
            wall((0, 4.6), (2.9, 4.6)),
            wall((3.8, 4.6), (5.1, 4.6)),
            wall((6.0, 4.6), (8.8, 4.6)),
            wall((9.7, 4.6), (10.4, 4.6)),
            wall((4.3, 0), (4.3, 1.1)),
            wall((4.3, 2.0), (4.3, 3.2)),
            wall((4.6, 4.6), (4.6, 8.1)),
            wall((7.7, 4.6), (7.7, 8.1)),
            box(0.3, 0.3, 1.4, 0.6),
            box(3.0, 0.9, 0.5, 0.5, 0.4),
            box(8.8, 1.2, 1.1, 0.7, -0.3),
            box(5.2, 0.2, 0.9, 0.4),
            box(0.4, 6.9, 1.9, 0.8),
            box(3.4, 6.0, 0.4, 0.4, 0.7),
            box(5.0, 7.2, 1.3, 0.5),
            box(9.3, 6.6, 0.7, 1.2),
        ]
    )


TOUR = (
    (2.0, 2.4), (2.05, 3.9), (3.4, 3.9), (3.35, 5.3), (1.3, 5.9), (3.3, 5.3), (3.4, 3.9), (5.6, 3.9), (5.55, 5.6),
    (6.9, 6.3), (5.5, 5.6), (5.6, 3.9), (9.2, 3.9), (9.25, 5.6), (8.5, 7.2), (9.2, 5.5), (9.2, 3.95), (6.8, 3.9),
    (6.75, 2.2), (8.0, 1.0), (6.4, 1.6), (3.9, 1.55), (2.1, 1.6), (2.05, 3.9), (6.8, 3.9), (6.75, 2.3),
)  # fmt: skip


def poses_along(way: Sequence[tuple[float, float]], heading_rad: float = 0.3) -> Floats:
    """Every 0.1 m and 0.12 rad a pose (x, y, heading); the robot turns on the spot."""
    poses = [(*way[0], heading_rad)]
    for x, y in way[1:]:
        px, py, heading = poses[-1]
        bearing = math.atan2(y - py, x - px)
        turn = (bearing - heading + math.pi) % math.tau - math.pi
        turns = max(math.ceil(abs(turn) / TURN_RAD), 1)
        poses += [(px, py, heading + turn * k / turns) for k in range(1, turns + 1)]
        length = math.hypot(x - px, y - py)
        steps = max(math.ceil(length / STEP_M), 1)
        poses += [
            (px + (x - px) * k / steps, py + (y - py) * k / steps, heading + turn)
            for k in range(1, steps + 1)
        ]
    return np.array(poses)


def cast(walls: Floats, pose: Floats, people: Floats, bearings: Floats) -> Floats:
    """How far it is to the nearest wall or person (x, y, radius) along each bearing; inf where there is none."""
    directions = np.stack([np.cos(pose[2] + bearings), np.sin(pose[2] + bearings)], axis=1)
    ex, ey = walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1]
    wx, wy = walls[:, 0] - pose[0], walls[:, 1] - pose[1]
    dx, dy = directions[:, :1], directions[:, 1:]
    across = dx * ey - dy * ex
    across[across == 0] = 1e-300
    along, part = (wx * ey - wy * ex) / across, (wx * dy - wy * dx) / across
    nearest = np.where((along > 0) & (part >= 0) & (part <= 1), along, np.inf).min(axis=1)
    for x, y, radius in people:
        px, py = x - pose[0], y - pose[1]
        middle = directions @ [px, py]
        inside = radius**2 - (px * px + py * py - middle**2)
        reached = np.where((inside > 0) & (middle > 0), middle - np.sqrt(np.maximum(inside, 0)), np.inf)
        nearest = np.minimum(nearest, np.where(reached > 0, reached, np.inf))
    return nearest


@dataclass
class Lidar:
    """270 beams all around, a centimetre of noise, one in fifty lost."""

    walls: Floats
    seed: int
    bearings: Floats = field(default_factory=lambda: -math.pi + math.tau / BEAMS * np.arange(BEAMS))

    def __post_init__(self) -> None:
        self._chance = np.random.default_rng(self.seed)

    def points(self, pose: Floats, people: Floats | None = None) -> NDArray[np.float32]:
        """What it sees from a pose, in the robot's frame, in beam order."""
        ranges = cast(self.walls, pose, np.zeros((0, 3)) if people is None else people, self.bearings)
        ranges = ranges + self._chance.normal(0, NOISE_M, BEAMS)
        good = (ranges < MAX_RANGE_M) & (self._chance.random(BEAMS) > DROPPED)
        bearings = self.bearings[good]
        seen = np.stack([np.cos(bearings), np.sin(bearings)], axis=1) * ranges[good, None]
        return seen.astype(np.float32)


def odometry(truth: Floats, seed: int, scale: float = 1.04, turn_scale: float = 0.96) -> Floats:
    """What worn wheels make of a course: too long, turned too little, pulling to the left, and noisy."""
    chance = np.random.default_rng(seed)
    poses = [(0.0, 0.0, 0.0)]
    for before, after in pairwise(truth):
        cos, sin = math.cos(before[2]), math.sin(before[2])
        dx, dy = after[0] - before[0], after[1] - before[1]
        turn = (after[2] - before[2] + math.pi) % math.tau - math.pi
        way = math.hypot(dx, dy)
        ax = scale * (cos * dx + sin * dy) + chance.normal(0, 0.02 * way)
        ay = scale * (cos * dy - sin * dx)
        turned = turn_scale * turn + 0.02 * way + chance.normal(0, 0.02 * abs(turn) + 0.01 * way)
        x, y, heading = poses[-1]
        cos, sin = math.cos(heading), math.sin(heading)
        poses.append((x + cos * ax - sin * ay, y + sin * ax + cos * ay, heading + turned))
    return np.array(poses)


def to_walls_m(walls: Floats, points: Floats) -> Floats:
    """How far each point is from the nearest wall."""
    start, end = walls[None, :, :2], walls[None, :, 2:]
    along, here = end - start, points[:, None] - start
    part = np.clip((here * along).sum(axis=2) / (along * along).sum(axis=2), 0, 1)
    return np.hypot(*np.moveaxis(here - part[..., None] * along, 2, 0)).min(axis=1)


def walking(steps: int, *paths: tuple[tuple[float, float], tuple[float, float]]) -> Iterator[Floats]:
    """People (x, y, radius) who walk to and fro between two points, a step of 12 cm for each scan."""
    for k in range(steps):
        people = []
        for (ax, ay), (bx, by) in paths:
            length = math.hypot(bx - ax, by - ay)
            part = abs((0.12 * k / length) % 2 - 1)
            people.append((ax + (bx - ax) * part, ay + (by - ay) * part, 0.2))
        yield np.array(people)
