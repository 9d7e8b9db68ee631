"""The step ``umbmark``: the ratio of the radii and the track, with a start mark and a tape, for robots without a lidar.

Squares both ways round, after Borenstein and Feng, "Measurement and Correction of Systematic Odometry Errors in Mobile
Robots", IEEE Transactions on Robotics and Automation 12(6), 1996. What a person measures is where the robot stands at
the end, as seen from the start mark. A closed course does not show the size of the wheels: it stays as configured.

A recorded drive may be of any loops that end where they began, both ways round, with a pause after each.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from chefbotd.components.calibration.algorithms.least_squares import Floats, solve
from chefbotd.components.calibration.algorithms.rolling import Rolling, rolling
from chefbotd.components.calibration.algorithms.step import (
    Ask,
    ConfiguredRobot,
    Estimate,
    Measurements,
    Move,
    Plot,
    Procedure,
    Residual,
    Series,
    Status,
    StepDefinition,
    StepResult,
)
from chefbotd.components.calibration.algorithms.wheel_model import NOMINAL, WheelModel, dead_reckon
from chefbotd.core.events import WheelsDriven
from chefbotd.core.geometry import Twist2D

NAME = "umbmark"
SIDE_M, RUNS = 1.5, 3
"""Of the square, and squares each way round: the more, the less random slip counts."""

SPEED_SHARE, TURN_SHARE = 0.7, 0.3
PAUSE_S = 4.0
"""The robot stands so long after a square, longer than between its sides; then it may be moved by hand."""

LOOPS = f"{NAME}.loops"
"""Answered with 1, every course of a drive ended on its own start mark."""

SIGMA_M = 0.01
MOST_OFF, MOST_LEFT_M = 0.2, 0.3
SURE_RATIO, SURE_TRACK = 0.005, 0.01
FARTHEST_M = 1.5


def _missing(robot: ConfiguredRobot) -> str:
    return "with the robot's lidar 'wheels' finds the same and more" if robot.lidars else ""


def _directions() -> Iterator[tuple[str, int]]:
    for number in range(1, RUNS + 1):
        yield f"left{number}", 1
        yield f"right{number}", -1


def _procedure(robot: ConfiguredRobot) -> Procedure:
    rim_m_s, track_m = robot.drive.max_rim_speed_m_s, robot.chassis.effective_track_m
    ahead_m_s = min(SPEED_SHARE * rim_m_s, robot.limits.linear.axis.max_forward)
    turn_rad_s = min(2 * TURN_SHARE * rim_m_s / track_m, robot.limits.angular.axis.max_forward)
    for number, (name, sign) in enumerate(_directions()):
        done, side = number / (2 * RUNS), "left" if sign > 0 else "right"
        mark = (
            f"Put the robot on the start mark, exactly along its line; it turns to the {side} next. Type 1."
        )
        yield Ask(f"{NAME}.{name}.ready", mark, "", 1, 1, done)
        for _ in range(4):
            yield Move(Twist2D(ahead_m_s), SIDE_M / ahead_m_s, "drives a side", done)
            yield Move(
                Twist2D(0.0, sign * turn_rad_s), math.pi / 2 / turn_rad_s, f"turns to the {side}", done
            )
        yield Move(None, PAUSE_S, "stands", done)
        for axis, where in (("x", "ahead of"), ("y", "to the left of")):
            text = f"How far {where} the start mark does it stand? Less than 0: the other way."
            yield Ask(f"{NAME}.{name}.{axis}_m", text, "m", -FARTHEST_M, FARTHEST_M, done)


def _fit(robot: ConfiguredRobot, measurements: Measurements) -> StepResult:
    rolled = rolling(robot.chassis, measurements.wheels)
    if rolled is not None and measurements.answers.get(LOOPS):
        return _of_loops(robot, _squares(rolled, measurements.driven))
    ends = _ends(measurements.answers)
    if rolled is None or not ends:
        return _without(Status.NOT_ENOUGH, "no squares with both errors typed in")
    squares = _squares(rolled, measurements.driven)
    if len(squares) != len(ends):
        return _without(Status.NOT_ENOUGH, f"{len(squares)} squares were driven, and {len(ends)} measured")
    if {name[:4] for name in ends} != {"left", "righ"}:
        return _without(Status.NOT_ENOUGH, "squares both ways round")
    return _judge_squares(robot, squares, np.array(list(ends.values())))


def _of_loops(robot: ConfiguredRobot, loops: list[tuple[Floats, Floats]]) -> StepResult:
    """Courses that ended where they began; one way round alone does not tell the track from the ratio."""
    turned_m = [float((right - left).sum()) for left, right in loops]
    if not (min(turned_m, default=0.0) < 0 < max(turned_m, default=0.0)):
        return _without(Status.NOT_ENOUGH, f"loops both ways round, with {PAUSE_S:g} s of rest after each")
    return _judge_squares(robot, loops, np.zeros((len(loops), 2)))


def _ends(answers: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Where the robot stood after each square, in the order of driving; those without both errors are left out."""
    keys = {name: (f"{NAME}.{name}.x_m", f"{NAME}.{name}.y_m") for name, _ in _directions()}
    return {name: (answers[x], answers[y]) for name, (x, y) in keys.items() if x in answers and y in answers}


def _squares(rolled: Rolling, driven: tuple[WheelsDriven, ...]) -> list[tuple[Floats, Floats]]:
    """What both sides rolled in the steps of each square: pauses as long as after a square part one from the next."""
    moving_s = [step.stamp_s for step in driven if any(step.target_rad_s)]
    squares, begin = list[tuple[Floats, Floats]](), 0
    for end in range(1, len(moving_s) + 1):
        if end < len(moving_s) and moving_s[end] - moving_s[end - 1] < PAUSE_S * 0.8:
            continue
        first, last = rolled.row(moving_s[begin] - 0.1), rolled.row(moving_s[end - 1] + PAUSE_S * 0.6)
        rows = slice(first, last + 1)
        squares.append((np.diff(rolled.left_m[rows]), np.diff(rolled.right_m[rows])))
        begin = end
    return squares


def _judge_squares(robot: ConfiguredRobot, squares: list[tuple[Floats, Floats]], ends: Floats) -> StepResult:
    track_m = robot.chassis.effective_track_m

    def off_m(model: WheelModel) -> Floats:
        reached = [dead_reckon(model, track_m, left, right)[-1, :2] for left, right in squares]
        return np.array(reached) - ends

    solution = solve(lambda values: off_m(_model(values)) / SIGMA_M, np.array([0.0, 1.0]))
    model, sigmas = _model(solution.values), solution.sigmas
    if not solution.is_determined or 2 * sigmas[0] > SURE_RATIO or sigmas[1] > SURE_TRACK:
        return _without(Status.NOT_ENOUGH, "the squares scatter too much: more of them, or a better floor")
    before, after = off_m(NOMINAL), off_m(model)
    if float(np.hypot(*after.T).max()) > MOST_LEFT_M:
        return _without(
            Status.REFUSED, "a square ended far from where the wheels can have brought it: slip, or a typo?"
        )
    if max(abs(value - 1) for value in (model.left, model.right, model.track)) > MOST_OFF:
        return _without(
            Status.REFUSED, "the wheels would be far from what is configured: check the signs of the errors"
        )
    chassis = robot.chassis
    factors = (
        ("left_radius_multiplier", chassis.left_radius_multiplier, model.left, sigmas[0]),
        ("right_radius_multiplier", chassis.right_radius_multiplier, model.right, sigmas[0]),
        ("track_multiplier", chassis.track_multiplier, model.track, sigmas[1]),
    )
    rms_before, rms_after = (math.sqrt(float((off**2).mean())) for off in (before, after))
    return StepResult(
        NAME,
        Status.PASSED,
        "the size of the wheels stays as configured: a closed course does not show it",
        (
            *(
                Estimate(f"chassis.{k}", "", v, v * factor, v * float(sigma))
                for k, v, factor, sigma in factors
            ),
            *robot.left_uncertain({"ratio_sigma": 2 * float(sigmas[0]), "track_sigma": float(sigmas[1])}),
        ),
        (Residual("place after a square", "m", rms_before, rms_after, len(ends)),),
        (_plot(before, after),),
    )


def _model(values: Floats) -> WheelModel:
    """Of half of the radii's difference, and the factor on the track."""
    difference, track = values.tolist()
    return WheelModel(1 - difference, 1 + difference, track)


def _plot(before: Floats, after: Floats) -> Plot:
    clouds = tuple(
        Series(name, tuple((1e3 * off[:, 0]).tolist()), tuple((1e3 * off[:, 1]).tolist()), points=True)
        for name, off in (("before", before), ("after", after))
    )
    return Plot("How far off odometry is after each square", "x (mm)", "y (mm)", clouds, equal=True)


def _without(status: Status, reason: str) -> StepResult:
    return StepResult(NAME, status, reason)


UMBMARK = StepDefinition(
    NAME,
    "the radii's ratio and the track, with a tape",
    "Draw a start mark with a line along the robot on the floor, at a corner of 1.9 by 1.9 m that are free ahead of it, "
    "to its left and to its right. Have a tape at hand.",
    1.9,
    _missing,
    _procedure,
    _fit,
    on_request=True,
)
