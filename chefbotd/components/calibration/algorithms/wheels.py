"""The step ``wheels``: radii, track and the lidar's mount, by driving to and fro while a lidar looks on.

Stop and go after Censi, Franchi, Marchionni and Oriolo, "Simultaneous calibration of odometry and sensor parameters for
mobile robots", IEEE Transactions on Robotics 29(2), 2013. It needs no tape, no start mark and no map.
"""

import importlib.util
import math
from collections.abc import Iterator

from chefbotd.components.calibration.algorithms.space import free_space
from chefbotd.components.calibration.algorithms.step import (
    ConfiguredRobot,
    Measurements,
    Move,
    Procedure,
    StepDefinition,
    StepResult,
)
from chefbotd.core.geometry import Twist2D
from chefbotd.extras import how_to_add_extra

SPACE_M = 0.55
MARGIN_M = 0.3
"""From what stands around: nearer, the obstacle guard would slow the robot."""

LEAST_REACH_M, MOST_REACH_M = 0.25, 0.5
"""How far from the start the middle of the axle gets, as there is space."""

SPEED_SHARE = 0.9
"""Of the fastest that a rim can: the controller needs a little room."""

SMALL_M, SMALL_RAD = 0.25, 0.8
"""The first motions: small enough that a wheel which is wired wrongly does no harm."""

LEAST_RADIUS = 0.6
"""Of a circle, in tracks: on a smaller one the inner wheel would stand."""

TURNS = 1.5
"""Of a circle: the robot ends opposite of where it began, so that the lidar measures the circle's diameter."""

CYCLES = 2
LOOK_S = 0.8


def missing(robot: ConfiguredRobot) -> str:
    """What this robot lacks for driving while a lidar looks on."""
    if importlib.util.find_spec("numba") is None:
        return f"matching scans needs the extra 'navigation': {how_to_add_extra('navigation')}"
    return "" if robot.lidars else "the robot has no lidar"


def _procedure(robot: ConfiguredRobot) -> Procedure:
    yield from drive_and_look(robot, CYCLES)


def drive_and_look(robot: ConfiguredRobot, cycles: int) -> Procedure:
    """Small motions, and so many cycles of larger ones, bounded by the space that the first scan shows."""
    seen = yield Move(None, LOOK_S, "looks around")
    space = free_space(robot, seen.scans)
    reach_m = MOST_REACH_M if space is None else space.distance_m - MARGIN_M
    moves = list(_moves(robot, cycles, min(max(reach_m, LEAST_REACH_M), MOST_REACH_M)))
    total_s = sum(seconds for _, seconds, _ in moves) + LOOK_S * len(moves)
    done_s = 0.0
    for twist, seconds, text in moves:
        yield Move(twist, seconds, text, done_s / total_s)
        done_s += seconds + LOOK_S
        yield Move(None, LOOK_S, "looks around", done_s / total_s)


def _moves(robot: ConfiguredRobot, cycles: int, reach_m: float) -> Iterator[tuple[Twist2D, float, str]]:
    """Small motions first, that show the signs; then circles and turns on the spot both ways, and straights.

    The inner wheel of a circle never stands: friction would make it jerk. A circle there and back ends a little ahead of
    its start, or behind it if it begins in reverse, because the limits let the speed rise sooner than the turn.
    """
    track_m, rim_m_s = robot.chassis.effective_track_m, SPEED_SHARE * robot.drive.max_rim_speed_m_s
    radius_m = max(reach_m / 2, LEAST_RADIUS * track_m)
    angular, linear = robot.limits.angular.axis, robot.limits.linear.axis
    turn_rad_s = min(rim_m_s / (radius_m + track_m / 2), angular.max_forward, angular.max_reverse)
    turn_rad_s = min(turn_rad_s, linear.max_forward / radius_m)
    spin_rad_s = min(2 * rim_m_s / track_m, angular.max_forward, angular.max_reverse)
    ahead_m_s = min(rim_m_s, linear.max_forward, linear.max_reverse or linear.max_forward)
    for sign in (1, -1):
        yield Twist2D(0.0, sign * spin_rad_s / 2), 2 * SMALL_RAD / spin_rad_s, "turns a little"
    for sign in (1, -1):
        yield Twist2D(sign * ahead_m_s / 2), 2 * SMALL_M / ahead_m_s, "drives a little"
    circle_s = TURNS * math.tau / turn_rad_s
    for cycle in range(cycles):
        for side in (1, -1):
            for sign in (1, -1) if cycle % 2 == 0 else (-1, 1):
                twist = Twist2D(sign * turn_rad_s * radius_m, sign * side * turn_rad_s)
                yield twist, circle_s, f"circles to the {'left' if side > 0 else 'right'}"
        for lengths in (1, -2, 1):
            speed_m_s = math.copysign(ahead_m_s, lengths)
            yield Twist2D(speed_m_s), abs(lengths) * reach_m / ahead_m_s, "drives straight"
        for sign in (1, -1):
            yield Twist2D(0.0, sign * spin_rad_s), (2.5 - cycle / 4) * math.tau / spin_rad_s, "turns"


def _fit(robot: ConfiguredRobot, measurements: Measurements) -> StepResult:
    from chefbotd.components.calibration.algorithms.wheel_result import (
        fit_wheels,  # matches scans, so it loads a compiler
    )

    return fit_wheels(robot, measurements)


WHEELS = StepDefinition(
    "wheels",
    "wheel radii, track and the lidar's mount",
    "Put the robot on the floor where it will drive, among furniture or walls that its lidar sees.",
    SPACE_M,
    missing,
    _procedure,
    _fit,
)
