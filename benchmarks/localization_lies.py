"""A robot that stands is told a wrong pose, or was carried there: how long it stays localized at the wrong place.

A lie is the true pose turned round, 2.5 m along one of the map's axes, or somewhere else in the building.
"""

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from benchmarks.figures import Figure
from chefbotd.components.localization.algorithms.agreement import agreement
from chefbotd.components.localization.algorithms.searching import LocalizationMap, localization_map
from chefbotd.components.localization.algorithms.state import PoseState, set_pose
from chefbotd.components.mapping.algorithms.surfaces import Singles
from chefbotd.components.simulation.scene import of_solids
from chefbotd.components.simulation.worlds.office import OFFICE
from chefbotd.core.poses import Floats, compose
from chefbotd.core.record import Record
from tests.chefbotd.components.localization.algorithms.buildings import (
    PERIOD_S,
    Robot,
    corridor_of_mirrored_rooms,
    drawn,
    off,
    scan_of,
)
from tests.chefbotd.components.mapping.algorithms.slam.flat import NOISE_M, Lidar, to_walls_m

COUNT, QUICK_COUNT, STANDING_S = 64, 8, 10.0
BELIEVED_M, BELIEVED_DEG = 0.3, 20.0
CLEARANCE_M, BESIDE_M = 0.3, 0.6
"""How far from everything the robot stands, and how far beside a tour of the building at most."""

ALIKE = 0.04
"""Where a wrong pose fits worse than the truth by less, nothing in the scan tells them apart."""

BEFORE_S, TRIES = 3.0, 100
LIDAR_HEIGHT_M = 0.3

Look = Callable[[Floats], Singles]


class Building(Record, frozen=True):
    """A map, where the robot may stand in it, and what its lidar sees from a pose."""

    name: str
    within: LocalizationMap
    somewhere: Callable[[np.random.Generator], Floats]
    is_inside: Callable[[Floats], bool]
    lidar: Callable[[int], Look]


def office() -> Building:
    """The simulator's office at the height of a lidar: a corridor of 24 m, and rooms that look alike."""
    edges, _ = of_solids(OFFICE.solids, OFFICE.start).slice(LIDAR_HEIGHT_M)
    return _of_walls("office", edges, OFFICE.tour)


def mirrored_corridor() -> Building:
    """A corridor of 14 m with a room at either end, the one the other's mirror image."""
    tour = ((1.45, 2.6), (1.45, 0.9), (12.55, 0.9), (12.55, 2.6))
    return _of_walls("mirrored corridor", corridor_of_mirrored_rooms(), tour)


def _of_walls(name: str, walls: Floats, tour: Sequence[tuple[float, float]]) -> Building:
    points = np.array(tour)

    def somewhere(chance: np.random.Generator) -> Floats:
        while True:
            k, part = int(chance.integers(len(points) - 1)), chance.uniform()
            x, y = points[k] + part * (points[k + 1] - points[k]) + chance.uniform(-0.4, 0.4, 2)
            if to_walls_m(walls, np.array([[x, y]]))[0] > CLEARANCE_M:
                return np.array([x, y, chance.uniform(-math.pi, math.pi)])

    def is_inside(pose: Floats) -> bool:
        beside = to_walls_m(np.hstack([points[:-1], points[1:]]), pose[None, :2])[0] <= BESIDE_M
        return bool(beside and to_walls_m(walls, pose[None, :2])[0] > CLEARANCE_M)

    within = localization_map(drawn(walls))
    return Building(name, within, somewhere, is_inside, lambda seed: Lidar(walls, seed).points)


def of_recording(name: str, within: LocalizationMap, truth: Floats, points: list[Singles]) -> Building:
    """The map of a recording; the robot stands where a scan was taken, and sees that scan with a centimetre of noise."""

    def somewhere(chance: np.random.Generator) -> Floats:
        return np.asarray(truth[chance.integers(len(truth))])

    def number(pose: Floats) -> int:
        return int(np.abs(truth - pose).sum(axis=1).argmin())

    def lidar(seed: int) -> Look:
        chance = np.random.default_rng(seed)
        return lambda pose: (
            points[number(pose)] + chance.normal(0, NOISE_M, points[number(pose)].shape)
        ).astype(np.float32)

    return Building(name, within, somewhere, lambda pose: bool((truth == pose).all(axis=1).any()), lidar)


def wrong_pose(building: Building, seed: int, *, is_inside: bool) -> tuple[Floats, Floats]:
    """A true pose, and a wrong one; ``is_inside``: the robot can stand there, too."""
    chance = np.random.default_rng(seed)
    for k in range(seed, seed + TRIES):
        truth, aside = building.somewhere(chance), float(chance.choice([-2.5, 2.5]))
        along, turned = np.array([aside, 0, 0]), compose(truth, np.array([0, 0, math.pi]))
        lie = (turned, truth + along, truth + along[[1, 0, 2]], building.somewhere(chance))[k % 4]
        if not is_inside or building.is_inside(lie):
            return truth, lie
    raise ValueError(f"{building.name}: no wrong pose lies inside")


def believed_s(building: Building, seed: int, *, is_carried: bool) -> tuple[float, float]:
    """How long a robot that stands is localized at a wrong pose; first where it fits worse than the truth, then in all.

    The pose is set by a person, or the robot stood there until it was carried away.
    """
    (truth, lie), look = wrong_pose(building, seed, is_inside=is_carried), building.lidar(seed)
    robot, grids, still = Robot(building.within), building.within.surfaces.grids, np.zeros(3)
    robot.now = set_pose(robot.now, lie)
    if is_carried:
        robot.look(still, lambda: look(lie), round(BEFORE_S / PERIOD_S))
    refuted = scans = 0
    for _ in range(round(STANDING_S / PERIOD_S)):
        points = look(truth)
        report = robot.take(still, points)
        off_m, off_deg = off(report, truth)
        if report.state is PoseState.LOCALIZED and (off_m > BELIEVED_M or off_deg > BELIEVED_DEG):
            scans += 1
            refuted += report.fit < agreement(grids, truth, scan_of(points)).fit - ALIKE
    return PERIOD_S * refuted, PERIOD_S * scans


def figures(building: Building, *, quick: bool) -> Iterator[Figure]:
    """How many lies are believed for over 1 s, and the longest time."""
    count = QUICK_COUNT if quick else COUNT
    for what, is_carried in (("set", False), ("carried there", True)):
        times = [believed_s(building, seed, is_carried=is_carried) for seed in range(count)]
        name = f"{building.name}, wrong poses, {what}: localized at"
        yield Figure(f"{name} for over 1 s, of {count}", sum(s > 1.0 for s, _ in times), "", 0)
        yield Figure(f"{name}, longest", max(s for s, _ in times), "s", 1.0)
        alike = sum(everywhere_s > 1.0 for s, everywhere_s in times if s <= 1.0)
        yield Figure(f"{name} for over 1 s, where the scan fits as well as at the truth", alike, "")
