"""The filter of odometry, held against the same filter written with matrices."""

import math
import random
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from chefbotd.core.geometry import Pose2D
from chefbotd.motion.motion_filter import (
    Considered,
    MotionEstimate,
    MotionStep,
    at_pose,
    predict,
    surprise,
    with_bias,
    with_imu_heading,
    with_new_offset,
    with_new_turn_errors,
    with_unknown_bias,
)

Matrix = NDArray[np.float64]
CONSIDERED = Considered(1e-4, 2e-4, 3e-4, 4e-4)
X, Y, HEADING, OFFSET, BIAS, SIZE, TURN, PER_M, IMU = range(9)


def matrix(now: MotionEstimate, considered: Considered = CONSIDERED) -> Matrix:
    """All nine errors' covariance."""
    full, numbers = np.zeros((9, 9)), iter(now.covariance)
    for row in range(5):
        for column in range(row, 9):
            full[row, column] = full[column, row] = next(numbers)
    variances = considered.travel, considered.turn, considered.turn_per_m, considered.imu_heading
    full[range(5, 9), range(5, 9)] = variances
    return full


def moved(now: MotionEstimate, before: Matrix, step: MotionStep) -> Matrix:
    """The covariance after a step: ``F P F^T + G Q G^T``."""
    half = step.turned_rad / 2
    chord, middle = step.travel_m * (1 - half * half / 6), now.heading_rad + half
    dx, dy = chord * math.cos(middle), chord * math.sin(middle)
    turn = np.zeros(9)
    turn[[TURN, PER_M, BIAS]] = step.turned_rad, step.travel_m, -step.dt_s if step.bias_turns else 0.0
    heading = np.eye(9)[HEADING] + turn / 2
    jacobian = np.eye(9)
    jacobian[X] += -dy * heading + dx * np.eye(9)[SIZE]
    jacobian[Y] += dx * heading + dy * np.eye(9)[SIZE]
    jacobian[HEADING] += turn
    jacobian[OFFSET, [BIAS, IMU]] = 0.0 if step.bias_turns else step.dt_s, step.turned_rad
    noise = np.zeros((9, 2))
    noise[[X, Y, HEADING]] = [[math.cos(middle), -dy / 2], [math.sin(middle), dx / 2], [0, 1]]
    both = np.array(
        [[step.travel_variance_m2, step.shared_m_rad], [step.shared_m_rad, step.turn_variance_rad2]]
    )
    after = jacobian @ before @ jacobian.T + noise @ both @ noise.T
    after[OFFSET, OFFSET] += step.offset_variance_rad2
    after[BIAS, BIAS] += step.bias_variance_rad2_s2
    return after


def random_drive(seed: int, steps: int = 30, *, bias_turns: bool) -> tuple[MotionEstimate, Matrix]:
    """The state after random steps and headings, and its covariance by matrices."""
    chance = random.Random(seed)
    now = with_new_offset(MotionEstimate(0.1, 0.2, 0.3), 1.0, 1e-3)
    by_matrix = matrix(now)
    for _ in range(steps):
        travel_m, turned_rad = chance.gauss(0, 0.1), chance.gauss(0, 0.2)
        step = MotionStep(travel_m, turned_rad, 0.05, 1e-5, 2e-5, 3e-6, 1e-6, 1e-7, bias_turns)
        by_matrix = moved(now, by_matrix, step)
        now = predict(now, CONSIDERED, step)
    return now, by_matrix


@pytest.mark.parametrize("bias_turns", [False, True])
def test_the_covariance_is_that_of_the_matrices(bias_turns: bool) -> None:
    """After thirty random arcs each of the 35 numbers is the one that nine by nine matrices give."""
    now, by_matrix = random_drive(1, bias_turns=bias_turns)
    assert matrix(now) == pytest.approx(by_matrix, rel=1e-9, abs=1e-15)


def test_a_heading_corrects_as_schmidts_filter_does() -> None:
    """Gain, state and covariance are those of the matrices; the considered errors' own variances stay."""
    now, before = random_drive(2, bias_turns=False)
    observes = np.zeros(9)
    observes[[HEADING, OFFSET]] = 1.0
    variance = observes @ before @ observes + 1e-3
    gain = before @ observes / variance
    gain[5:] = 0.0
    shrunk = (np.eye(9) - np.outer(gain, observes)) @ before
    after = shrunk @ (np.eye(9) - np.outer(gain, observes)).T + 1e-3 * np.outer(gain, gain)
    heading_rad = now.heading_rad + now.offset_rad + 0.05
    assert surprise(now, heading_rad, 1e-3) == pytest.approx((0.05, variance))
    corrected = with_imu_heading(now, heading_rad, 1e-3)
    state = corrected.x_m, corrected.y_m, corrected.heading_rad, corrected.offset_rad, corrected.bias_rad_s
    old = now.x_m, now.y_m, now.heading_rad, now.offset_rad, now.bias_rad_s
    assert np.subtract(state, old) == pytest.approx(gain[:5] * 0.05)
    assert matrix(corrected)[:5, :5] == pytest.approx(after[:5, :5], rel=1e-9, abs=1e-15)
    assert matrix(corrected)[:5, 5:] == pytest.approx(after[:5, 5:], rel=1e-9, abs=1e-15)


def test_what_is_constant_is_never_averaged_away() -> None:
    """A heading scale that is off by 2 % (1 sigma): ten radians are off by 0.2, however many headings say the same."""
    now = with_new_offset(MotionEstimate(), 0.0, 1e-8)
    considered = Considered(turn=1.0, imu_heading=4e-4)
    now = predict(now, considered, MotionStep(0.0, 10.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, bias_turns=False))
    for _ in range(1000):
        now = with_imu_heading(now, 10.0, 1e-6)
    assert math.sqrt(now.pose_covariance.hh) == pytest.approx(0.2, rel=0.01)


def test_an_arc_ends_where_geometry_says() -> None:
    """A quarter of a circle of radius 1 m in a hundred steps ends at (1, 1), to the chord's second order."""
    now = MotionEstimate()
    for _ in range(100):
        step = MotionStep(math.pi / 200, math.pi / 200, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, bias_turns=True)
        now = predict(now, Considered(), step)
    assert (now.x_m, now.y_m, now.heading_rad) == pytest.approx((1.0, 1.0, math.pi / 2), abs=1e-8)


def test_a_declared_pose_is_certain_and_the_imu_stays() -> None:
    """The expected heading of the IMU is the same before and after; of the pose nothing is uncertain."""
    now, _ = random_drive(3, bias_turns=True)
    placed = at_pose(now, Pose2D(5.0, 6.0, 0.5))
    assert placed.odom_from_base == Pose2D(5.0, 6.0, 0.5)
    assert placed.pose_covariance.row_by_row == (0.0,) * 9
    assert surprise(placed, 2.0, 1e-3) == pytest.approx(surprise(now, 2.0, 1e-3))
    assert placed.bias_rad_s == now.bias_rad_s


def test_a_measured_bias_is_believed_by_its_variance() -> None:
    """Two equal variances: the bias goes half of the way, and its variance is half."""
    now = MotionEstimate(covariance=(*(0.0,) * 30, 1e-4, *(0.0,) * 4))
    now = with_bias(now, 0.02, 1e-4)
    assert now.bias_rad_s == pytest.approx(0.01)
    assert now.covariance[30] == pytest.approx(5e-5)


@pytest.mark.parametrize("change", [with_new_turn_errors, lambda now: with_unknown_bias(now, 0.1)])
def test_the_covariance_stays_possible(change: Callable[[MotionEstimate], MotionEstimate]) -> None:
    """No combination of the errors has a negative variance when the turn comes from another sensor."""
    now, _ = random_drive(4, bias_turns=True)
    assert np.linalg.eigvalsh(matrix(change(now)))[0] > -1e-12
    smaller = Considered(1e-4, 1e-9, 0.0, 4e-4)
    assert np.linalg.eigvalsh(matrix(with_new_turn_errors(now), smaller))[0] > -1e-12
