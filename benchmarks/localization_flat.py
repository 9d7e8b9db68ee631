"""Localization in a simulated flat, against the truth: tracking, untold starts, kidnappings, rooms that look alike.

The flat's walls, its lidar and odometry, and the robot that drives are those of the tests.
"""

import math
import time
from collections.abc import Iterable

import numpy as np

from benchmarks.figures import Figure
from chefbotd.components.localization.algorithms.agreement import agreement
from chefbotd.components.localization.algorithms.searching import LocalizationMap, localization_map
from chefbotd.components.localization.algorithms.state import PoseState, set_pose
from chefbotd.components.mapping.algorithms.finish import refine_graph
from chefbotd.components.mapping.algorithms.occupancy import occupancy
from chefbotd.components.mapping.algorithms.parameters import SlamParameters
from chefbotd.components.mapping.algorithms.refine import Prior, polish
from chefbotd.components.mapping.algorithms.slam import step as slam_step
from chefbotd.components.mapping.algorithms.state import start
from chefbotd.core.poses import Floats, compose
from chefbotd.core.record import replace
from tests.chefbotd.components.localization.algorithms.buildings import (
    Robot,
    drawn,
    mirrored,
    off,
    scan_of,
    twin_rooms,
)
from tests.chefbotd.components.mapping.algorithms.slam.flat import (
    TOUR,
    Lidar,
    furnished_flat,
    odometry,
    poses_along,
    to_walls_m,
    walking,
)

WALLS = furnished_flat()
TRUTH = poses_along(TOUR)
PATHS = (((0.6, 4.3), (9.8, 4.3)), ((1.0, 2.5), (4.0, 1.6)), ((5.0, 5.2), (7.0, 6.8)))
STARTS, QUICK_STARTS, LOOKING_S = 50, 10, 10.0
CIRCLE_M, TURN_RAD = 0.12, 0.05
KIDNAPPINGS, QUICK_KIDNAPPINGS, NOTICED_S = 20, 4, 3.0
DRIVES, QUICK_DRIVES = 5, 1
RIGHT_M, RIGHT_DEG = 0.2, 5.0
TWIN_LOOKS = 40
WRONG_POSES, QUICK_WRONG_POSES, BELIEVED_M = 64, 8, 0.3


def figures(*, quick: bool) -> tuple[list[Figure], list[str]]:
    """All of it, and what is told of the fit."""
    within, drives = localization_map(drawn(WALLS)), QUICK_DRIVES if quick else DRIVES
    tracked, fits, seconds = _tracking(within, drives)
    tracked += _on_its_own_map()
    found = [
        *_starts(within, QUICK_STARTS if quick else STARTS),
        *_kidnappings(within, QUICK_KIDNAPPINGS if quick else KIDNAPPINGS),
        *_wrong_poses(within, QUICK_WRONG_POSES if quick else WRONG_POSES),
        *_look_alikes(),
    ]
    cost = Figure("flat, a scan of 270 beams, median", 1e3 * float(np.median(seconds)), "ms", 1.0, "MRPT 2.2")
    return [*tracked, *found, cost], [_fits(within, fits)]


def _tracking(within: LocalizationMap, drives: int) -> tuple[list[Figure], list[float], list[float]]:
    """The tour with three people about, from a start that nobody tells."""
    errors, fits, seconds, without = list[tuple[float, float]](), list[float](), list[float](), 0
    for seed in range(-1, drives):
        lidar, robot, people = Lidar(WALLS, seed + 1), Robot(within), walking(len(TRUTH), *PATHS)
        for told, pose in zip(odometry(TRUTH, seed + 1), TRUTH, strict=True):
            seen = lidar.points(pose, next(people))
            began_s = time.process_time()
            report = robot.take(told, seen)
            if seed < 0:  # compiles, and warms caches
                continue
            seconds.append(time.process_time() - began_s)
            if report.state is PoseState.LOCALIZED:
                errors.append(off(report, pose))
                fits.append(report.fit)
            without += report.state is not PoseState.LOCALIZED
    metres, degrees = np.array(errors).T
    return (
        [
            Figure("flat, tracking, median", float(np.median(metres)), "m", 0.02, "amcl 0.035"),
            Figure("flat, tracking, median", float(np.median(degrees)), "deg", 0.5),
            Figure("flat, tracking, p95", float(np.percentile(metres, 95)), "m", 0.05, "amcl 0.07 to 0.13"),
            Figure("flat, tracking, p95", float(np.percentile(degrees, 95)), "deg", 1.5, "amcl 2.8 to 3.5"),
            Figure(f"flat, scans without a sure pose, of {len(TRUTH) * drives}", without, ""),
        ],
        fits,
        seconds,
    )


def _on_its_own_map() -> list[Figure]:
    """Tracking on the map that our SLAM made of the same tour, whose first pose is its origin."""
    params, state, lidar = SlamParameters(), start(), Lidar(WALLS, 31)
    for k, (told, pose) in enumerate(zip(odometry(TRUTH, 31), TRUTH, strict=True)):
        state, _ = slam_step(params, state, float(k), told, scan_of(lidar.points(pose)))
    robot = Robot(localization_map(occupancy(refine_graph(params, state).nodes)))
    lidar, errors = Lidar(WALLS, 32), list[float]()
    for told, pose in zip(odometry(TRUTH, 32), TRUTH, strict=True):
        report = robot.take(told, lidar.points(pose))
        if report.map_from_base is not None:
            there = compose(TRUTH[0], report.map_from_base.pose)
            errors.append(math.dist(there[:2], pose[:2]))
    return [
        Figure("flat, tracking on a map of our SLAM, median", float(np.median(errors)), "m"),
        Figure("flat, tracking on a map of our SLAM, p95", float(np.percentile(errors, 95)), "m"),
    ]


def somewhere(chance: np.random.Generator) -> Floats:
    """A pose in the flat, 0.3 m or more from what stands there."""
    while True:
        x, y, heading = chance.uniform(0.3, 10.1), chance.uniform(0.3, 7.8), chance.uniform(-math.pi, math.pi)
        if to_walls_m(WALLS, np.array([[x, y]]))[0] > 0.3:
            return np.array([x, y, heading])


def _is_right(robot: Robot, truth: Floats) -> bool:
    metres, degrees = off(robot.reports[-1], truth)
    return metres < RIGHT_M and degrees < RIGHT_DEG


def _starts(within: LocalizationMap, starts: int) -> Iterable[Figure]:
    """Anywhere, driving slowly round a circle of 0.24 m for ten seconds."""
    found_s, wrong = list[float](), 0
    for seed in range(starts):
        chance, lidar, robot = np.random.default_rng(seed), Lidar(WALLS, seed), Robot(within)
        begin, first_s = somewhere(chance), math.inf
        for k in range(round(LOOKING_S / 0.1)):
            turn = TURN_RAD * k
            way = np.array([CIRCLE_M * math.sin(turn), CIRCLE_M * (1 - math.cos(turn)), turn])
            report = robot.take(way, lidar.points(compose(begin, way)))
            if report.state is not PoseState.LOCALIZED:
                continue
            if not _is_right(robot, compose(begin, way)):
                wrong += 1
                break
            first_s = min(first_s, robot.stamp_s)
        found_s.append(first_s)
    yield Figure(
        f"flat, starts not found within 10 s, of {starts}", sum(s > LOOKING_S for s in found_s), "", 0
    )
    yield Figure("flat, starts wrong and sure of it", wrong, "", 0)
    yield Figure("flat, time until found, longest", max(found_s), "s", LOOKING_S)


def _kidnappings(within: LocalizationMap, count: int) -> Iterable[Figure]:
    """Put from one place into another; the odometry stands still."""
    noticed_s, back_s = list[float](), list[float]()
    still = np.zeros(3)
    for seed in range(count):
        chance, lidar, robot = np.random.default_rng(1000 + seed), Lidar(WALLS, seed), Robot(within)
        before, after = somewhere(chance), somewhere(chance)
        while math.dist(before[:2], after[:2]) < 1.5:
            after = somewhere(chance)
        robot.now = set_pose(robot.now, before)
        robot.look(still, lambda lidar=lidar, before=before: lidar.points(before), 10)  # type: ignore[misc]
        first_s, again_s = math.inf, math.inf
        for k in range(1, 101):
            report = robot.take(still, lidar.points(after))
            if report.state is not PoseState.LOCALIZED or _is_right(robot, after):
                first_s = min(first_s, 0.1 * k)
            if report.state is PoseState.LOCALIZED and _is_right(robot, after):
                again_s = min(again_s, 0.1 * k)
        noticed_s.append(first_s)
        back_s.append(again_s)
    yield Figure(f"flat, kidnapping noticed, slowest of {count}", max(noticed_s), "s", NOTICED_S)
    yield Figure(f"flat, right again after it, slowest of {count}", max(back_s), "s", LOOKING_S)


def _wrong_poses(within: LocalizationMap, count: int) -> Iterable[Figure]:
    """Turned round, 2.5 m along a wall, or anywhere, while it stands: set by a person, or believed a moment ago."""
    for what, is_set in (("set", True), ("believed before", False)):
        longest_s, believed = 0.0, 0
        for seed in range(count):
            chance, lidar, robot = np.random.default_rng(seed), Lidar(WALLS, seed), Robot(within)
            truth, aside = somewhere(chance), float(chance.choice([-2.5, 2.5]))
            turned, along = compose(truth, np.array([0, 0, math.pi])), np.array([aside, 0, 0])
            lies = (turned, truth + along, truth + along[[1, 0, 2]])
            robot.now = set_pose(robot.now, (*lies, somewhere(chance))[seed % 4])
            if not is_set:
                found = (np.zeros(3), 0.95)
                robot.now = replace(robot.now, state=PoseState.LOCALIZED, is_unchecked=False, checked=found)
            scans = 0
            for _ in range(round(LOOKING_S / 0.1)):
                report = robot.take(np.zeros(3), lidar.points(truth))
                scans += report.state is PoseState.LOCALIZED and off(report, truth)[0] > BELIEVED_M
            longest_s, believed = max(longest_s, 0.1 * scans), believed + (scans > 10)
        yield Figure(f"flat, wrong poses, {what}: localized at for over 1 s, of {count}", believed, "", 0)
        yield Figure(f"flat, wrong poses, {what}: localized at, longest", longest_s, "s", 1.0)


def _look_alikes() -> Iterable[Figure]:
    """How often it is sure of a place where nothing tells: in one of two equal rooms, and on a mirrored map."""
    walls = twin_rooms()
    lidar, robot = Lidar(walls, 2), Robot(localization_map(drawn(walls)))
    pose = np.array([6.6, 1.9, 2.0])
    for _ in range(TWIN_LOOKS):
        robot.take(np.zeros(3), lidar.points(pose))
    sure = sum(report.state is PoseState.LOCALIZED for report in robot.reports)
    yield Figure(f"twin rooms, sure of one, of {TWIN_LOOKS} scans", sure, "", 0)
    yield Figure("twin rooms, places named (2 are right)", len(robot.reports[-1].alternatives), "", 2)
    robot, lidar = Robot(localization_map(mirrored(drawn(WALLS)))), Lidar(WALLS, 1)
    for told, pose in zip(odometry(TRUTH, 1), TRUTH, strict=True):
        robot.take(told, lidar.points(pose))
    sure = sum(report.state is PoseState.LOCALIZED for report in robot.reports)
    yield Figure(f"flat, mirrored map, sure of a place, of {len(TRUTH)} scans", sure, "", 0)


def _fits(within: LocalizationMap, right: list[float]) -> str:
    """The fit where the pose is right, half a metre off, and in another place; matching did its best from there."""
    chance, lidar, grids = np.random.default_rng(0), Lidar(WALLS, 5), within.surfaces.grids
    wrong: dict[str, list[float]] = {"half a metre off": [], "somewhere else": []}
    for pose in TRUTH[::3]:
        scan, way = scan_of(lidar.points(pose)), chance.uniform(0, math.tau)
        begins = (pose + np.array([0.5 * math.cos(way), 0.5 * math.sin(way), 0.0]), somewhere(chance))
        for name, begin in zip(wrong, begins, strict=True):
            found = polish(grids, scan.points, scan.facing, begin, Prior(begin, np.eye(3)), 0.03).pose
            if math.dist(found[:2], pose[:2]) > 0.25:
                wrong[name].append(agreement(grids, found, scan).fit)
    told = ", ".join(
        f"{name} {np.median(fits):.2f} ({np.percentile(fits, 95):.2f})" for name, fits in wrong.items()
    )
    return (
        f"fit, median (worst 5 %): right, with people about {np.median(right):.2f} ({np.percentile(right, 5):.2f});"
        f" median (best 5 %): {told}"
    )
