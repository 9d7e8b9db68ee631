"""The error of integration alone: a square with rounded corners, driven without slip, ticks read ten times a second.

The same whole ticks go through ``chefbotd.motion.odometry`` and through two approximations: the midpoint rule, and the
classic driver's, which turns the step by a full change of heading the wrong way round. The truth is the path itself.
"""

import cmath
import math
from collections.abc import Callable, Iterable, Iterator

from benchmarks.figures import Figure, Outcome
from chefbotd.core.geometry import STANDING, Pose2D
from chefbotd.motion import odometry
from chefbotd.motion.odometry import OdometryParameters

SIDE_M = 10.0
TRACK_WIDTH_M = 0.3
COUNT_M = math.pi * 0.09 / 4200
SPEED_M_S = 0.2
CORNER_RADIUS_M = 0.5
PERIOD_S = 0.1
PARAMETERS = OdometryParameters()

Step = tuple[float, float]
Integrator = Callable[[Pose2D, float, float], Pose2D]


def run(*, quick: bool = False) -> Outcome:
    """How far each way to integrate strays from the path, at its worst."""
    path = list(_path())
    steps, truth = list(_counted(path)), list(_positions(path))
    return Outcome(
        (
            Figure("exact arcs (chefbotd)", _worst_mm(_by_arcs, steps, truth), "mm", 1.0),
            Figure("midpoint rule", _worst_mm(_by_midpoint, steps, truth), "mm"),
            Figure("the classic driver's rule", _worst_mm(_by_classic_rule, steps, truth), "mm", None, "30"),
        )
    )


def _path() -> Iterator[Step]:
    """Left and right travel in metres per period along the closed path: four sides, each with its corner.

    A side or a corner is cut into equal periods of about the nominal length, so that every step is one exact arc.
    """
    straight, corner = (
        (SIDE_M - 2 * CORNER_RADIUS_M, 0.0),
        (math.pi / 2 * CORNER_RADIUS_M, 1 / CORNER_RADIUS_M),
    )
    for length_m, curvature_per_m in (straight, corner) * 4:
        periods = round(length_m / (SPEED_M_S * PERIOD_S))
        along_m, aside_m = length_m / periods, length_m / periods * curvature_per_m * TRACK_WIDTH_M / 2
        for _ in range(periods):
            yield along_m - aside_m, along_m + aside_m


def _positions(steps: Iterable[Step]) -> Iterator[complex]:
    """Where the path is after each step, as x + iy: the arc's chord, written without chefbotd's geometry."""
    position, heading = 0j, 1 + 0j
    for left_m, right_m in steps:
        turned_rad = (right_m - left_m) / TRACK_WIDTH_M
        turn = cmath.exp(1j * turned_rad)
        chord = (turn - 1) / (1j * turned_rad) if abs(turned_rad) > 1e-12 else 1.0
        position += heading * chord * (left_m + right_m) / 2
        heading *= turn
        yield position


def _counted(steps: Iterable[Step]) -> Iterator[Step]:
    """The same travel as encoders see it: whole counts of the running sums."""
    sums, counted = [0.0, 0.0], [0, 0]
    for step in steps:
        sums = [total + travel for total, travel in zip(sums, step, strict=True)]
        counts = [math.floor(total / COUNT_M + 0.5) for total in sums]
        left, right = ((new - old) * COUNT_M for new, old in zip(counts, counted, strict=True))
        yield left, right
        counted = counts


def _worst_mm(integrate: Integrator, steps: list[Step], truth: list[complex]) -> float:
    pose, worst_m = Pose2D(), 0.0
    for (left_m, right_m), position in zip(steps, truth, strict=True):
        pose = integrate(pose, left_m, right_m)
        worst_m = max(worst_m, abs(complex(pose.x_m, pose.y_m) - position))
    return worst_m * 1e3


def _by_arcs(pose: Pose2D, left_m: float, right_m: float) -> Pose2D:
    state = odometry.set_pose(odometry.START, pose)
    return odometry.integrate(PARAMETERS, TRACK_WIDTH_M, state, left_m, right_m, STANDING).odom_from_base


def _by_midpoint(pose: Pose2D, left_m: float, right_m: float) -> Pose2D:
    return _chord(pose, left_m, right_m, share_of_turn=0.5)


def _by_classic_rule(pose: Pose2D, left_m: float, right_m: float) -> Pose2D:
    return _chord(pose, left_m, right_m, share_of_turn=-1.0)


def _chord(pose: Pose2D, left_m: float, right_m: float, share_of_turn: float) -> Pose2D:
    """A straight step of the arc's length, along the heading plus a share of the turn."""
    travel_m, turned_rad = (left_m + right_m) / 2, (right_m - left_m) / TRACK_WIDTH_M
    along_rad = share_of_turn * turned_rad
    return pose.compose(Pose2D(travel_m * math.cos(along_rad), travel_m * math.sin(along_rad), turned_rad))
