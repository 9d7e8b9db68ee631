"""Squares with a tape: ratio and track are recovered, and what cannot be is said."""

import math

import numpy as np
import pytest

from chefbotd.components.calibration.algorithms.step import (
    Ask,
    ConfiguredRobot,
    Measurements,
    Move,
    Procedure,
    Status,
)
from chefbotd.components.calibration.algorithms.umbmark import LOOPS, UMBMARK
from chefbotd.components.calibration.algorithms.wheel_model import WheelModel
from chefbotd.core.events import WheelsDriven, WheelsMeasured
from chefbotd.core.geometry import Twist2D
from chefbotd.core.record import replace
from tests.chefbotd.components.calibration.algorithms.synthetic import Truth, World, configured

ROBOT = replace(configured(), lidars=())
MODEL = WheelModel(left=0.996, right=1.004, track=1.02)


def _drive(truth: Truth, seed: int = 1) -> Measurements:
    """All squares, each from the mark; a person reads the tape to the millimetre."""
    world = World(configured(), truth, seed)
    procedure, sent = UMBMARK.procedure(ROBOT), Measurements()
    wheels, driven, answers, start = [], list[WheelsDriven](), dict[str, float](), world.pose
    action = next(procedure, None)
    while action is not None:
        if isinstance(action, Ask):
            answers[action.key] = _seen(action, start, world)
            if action.key.endswith("ready"):
                start = world.pose.copy()
        else:
            part = world.perform(_only(action))
            wheels += part.wheels
            driven += _driven(action, part)
        try:
            action = procedure.send(sent)
        except StopIteration:
            break
    return Measurements(wheels=tuple(wheels), driven=tuple(driven), answers=answers)


def _only(action: Move) -> Procedure:
    yield action


def _driven(move: Move, part: Measurements) -> list[WheelsDriven]:
    target = (1.0, 1.0) if isinstance(move.motion, Twist2D) else (0.0, 0.0)
    count = round(move.duration_s / 0.05)
    return [
        WheelsDriven(one.stamp_s, (0.0, 0.0), (0.0, 0.0), target if k < count else (0.0, 0.0), (0, 0))
        for k, one in enumerate(part.wheels)
    ]


def _seen(ask: Ask, start: np.ndarray, world: World) -> float:
    """The tape, in the frame of the mark."""
    if ask.key.endswith("ready"):
        return 1.0
    dx, dy = (world.pose - start)[:2]
    cos, sin = math.cos(start[2]), math.sin(start[2])
    return round(float(cos * dx + sin * dy if ask.key.endswith("x_m") else cos * dy - sin * dx), 3)


@pytest.fixture(scope="module")
def drive() -> Measurements:
    """Three squares each way round by wheels that scatter."""
    return _drive(Truth(MODEL))


def test_ratio_and_track_are_recovered(drive: Measurements) -> None:
    """Within 0.2 % and 0.5 %, and four standard deviations; the size stays as configured."""
    result = UMBMARK.fit(ROBOT, drive)
    assert result.status is Status.PASSED, result.reason
    left, right, track = result.estimates[:3]
    assert left.after / right.after == pytest.approx(MODEL.left / MODEL.right, rel=2e-3)
    assert track.after == pytest.approx(MODEL.track, rel=5e-3)
    assert abs(track.after - MODEL.track) < 4 * track.sigma
    assert left.after + right.after == pytest.approx(2.0)
    assert result.residuals[0].after < result.residuals[0].before / 3


def test_squares_one_way_round_are_not_enough(drive: Measurements) -> None:
    """Both errors look alike then."""
    answers = {key: value for key, value in drive.answers.items() if "left" in key}
    result = UMBMARK.fit(ROBOT, replace(drive, answers=answers))
    assert (result.status, result.estimates) == (Status.NOT_ENOUGH, ())


def test_nothing_typed_is_not_enough(drive: Measurements) -> None:
    """No tape, no result."""
    assert UMBMARK.fit(ROBOT, replace(drive, answers={})).status is Status.NOT_ENOUGH


def test_errors_that_no_wheels_can_cause_are_no_result(drive: Measurements) -> None:
    """A metre to a random side after each square."""
    random = np.random.default_rng(3)
    answers = {key: float(random.uniform(-1, 1)) for key in drive.answers}
    result = UMBMARK.fit(ROBOT, replace(drive, answers=answers))
    assert (result.status is Status.PASSED, result.estimates) == (False, ())


def test_a_robot_with_a_lidar_does_not_need_it() -> None:
    """Who has a lidar is sent to ``wheels``."""
    robot: ConfiguredRobot = configured()
    assert "wheels" in UMBMARK.missing(robot)
    assert not UMBMARK.missing(ROBOT)


def _loops(signs: tuple[int, ...]) -> Measurements:
    """Squares of 1 m that truly end where they began, with rests: what the wheels of ``MODEL`` count meanwhile."""
    chassis = ROBOT.chassis
    true_track_m = chassis.effective_track_m * MODEL.track
    step_m, steps = 0.02, 50
    wheels, driven, now_s = list[WheelsMeasured](), list[WheelsDriven](), 0.0

    def roll(left_m: float, right_m: float, target: float) -> None:
        nonlocal now_s
        now_s += 0.05
        travel = tuple(
            m / factor / wheel.radius_m
            for m, factor, wheel in zip(
                (left_m, right_m), (MODEL.left, MODEL.right), chassis.wheels, strict=True
            )
        )
        wheels.append(WheelsMeasured(now_s, now_s, now_s, (0.0, 0.0), travel, (0.0, 0.0)))
        driven.append(WheelsDriven(now_s, (0.0, 0.0), (0.0, 0.0), (target, target), (0, 0)))

    for _ in range(20):
        roll(0.0, 0.0, 0.0)
    for sign in signs:
        for _ in range(4):
            for _ in range(steps):
                roll(step_m, step_m, 1.0)
            turn_m = sign * math.pi / 2 * true_track_m / 2 / steps
            for _ in range(steps):
                roll(-turn_m, turn_m, 1.0)
        for _ in range(90):
            roll(0.0, 0.0, 0.0)
    return Measurements(tuple(wheels), tuple(driven), answers={LOOPS: 1.0})


def test_a_recorded_drive_of_loops_tells_ratio_and_track() -> None:
    """Two squares each way round that end on their start mark: no tape, and no answer but that they do."""
    result = UMBMARK.fit(ROBOT, _loops((1, -1, 1, -1)))
    assert result.status is Status.PASSED, result.reason
    left, right, track = result.estimates[:3]
    assert left.after / right.after == pytest.approx(MODEL.left / MODEL.right, rel=2e-4)
    assert track.after == pytest.approx(MODEL.track, rel=1e-3)
    assert result.residuals[0].after < 1e-3


def test_loops_one_way_round_are_not_enough() -> None:
    """The ratio and the track then do the same."""
    result = UMBMARK.fit(ROBOT, _loops((1, 1)))
    assert (result.status, result.estimates) == (Status.NOT_ENOUGH, ())
    assert "both ways round" in result.reason
