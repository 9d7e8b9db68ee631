"""Dead reckoning: exact arcs, and a covariance that can be worked out or sampled."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.core.geometry import CERTAIN, STANDING, Pose2D, PoseCovariance, Twist2D
from chefbotd.motion import odometry
from chefbotd.motion.odometry import OdometryParameters, OdometryState, integrate
from tests.budget import examples

PARAMS = OdometryParameters(travel_variance_m2_per_m=1e-4, turn_variance_rad2_per_rad=3e-4)
EXACT = OdometryParameters(travel_variance_m2_per_m=0.0, turn_variance_rad2_per_rad=0.0)
TRACK_M = 1.0


def roll(
    state: OdometryState, *steps: tuple[float, float], params: OdometryParameters = PARAMS
) -> OdometryState:
    """Roll the left and right sides on by so many metres, step by step."""
    for left_m, right_m in steps:
        state = integrate(params, TRACK_M, state, left_m, right_m, STANDING)
    return state


def pose_of(state: OdometryState) -> tuple[float, float, float]:
    """Metres, metres, radians."""
    pose = state.odom_from_base
    return pose.x_m, pose.y_m, pose.heading_rad


def test_a_quarter_circle_about_the_left_wheel() -> None:
    """Track 1 m, left still, right rolls pi/2 m: the pose is (0.5, 0.5, 90 deg)."""
    state = roll(odometry.START, (0.0, math.pi / 2))
    assert pose_of(state) == pytest.approx((0.5, 0.5, math.pi / 2), abs=1e-15)


def test_straight_lines_are_exact() -> None:
    """Ten metres in steps that a double holds exactly end at exactly (10, 0, 0)."""
    assert pose_of(roll(odometry.START, *[(0.125, 0.125)] * 80)) == (10.0, 0.0, 0.0)


def test_a_turn_in_place_moves_nothing() -> None:
    """Sides rolling 0.25 m against each other on a 1 m track turn 0.5 rad on the spot."""
    assert pose_of(roll(odometry.START, (-0.25, 0.25))) == (0.0, 0.0, 0.5)


def test_backing_along_the_arc_returns() -> None:
    """The same arc in reverse ends where it began."""
    assert pose_of(roll(odometry.START, (0.3, 0.7), (-0.3, -0.7))) == pytest.approx((0, 0, 0), abs=1e-15)


def test_heading_is_wrapped() -> None:
    """Three quarter turns to the left are one to the right."""
    quarter = (-math.pi / 4, math.pi / 4)
    assert pose_of(roll(odometry.START, quarter, quarter, quarter))[2] == pytest.approx(-math.pi / 2)


def test_a_square_of_ten_metres_closes() -> None:
    """Four sides and four left turns return to the start within a nanometre, however finely they are cut."""
    side = [(0.01, 0.01)] * 1000
    turn = [(-math.pi / 400, math.pi / 400)] * 100
    end = roll(odometry.START, *(side + turn) * 4, params=EXACT)
    assert pose_of(end) == pytest.approx((0, 0, 0), abs=1e-9)


@given(st.floats(-1, 1), st.floats(-1, 1), st.integers(2, 20))
@settings(max_examples=examples(60))
def test_an_arc_does_not_depend_on_its_steps(left_m: float, right_m: float, steps: int) -> None:
    """One long step and many short ones of the same arc end at the same pose."""
    whole = roll(odometry.START, (left_m, right_m))
    parts = roll(odometry.START, *[(left_m / steps, right_m / steps)] * steps)
    assert pose_of(parts) == pytest.approx(pose_of(whole), abs=1e-12)


def test_certainty_is_lost_as_worked_out_by_hand() -> None:
    """One metre straight on a 1 m track: each side has 1e-4 m2.

    Along x the mean of the two: (1e-4 + 1e-4) / 4 = 0.5e-4. The heading, their difference over the track:
    2e-4. Sideways half the way times the heading's error: 0.5**2 * 2e-4 = 0.5e-4, correlated: 0.5 * 2e-4.
    """
    expected = [[0.5e-4, 0, 0], [0, 0.5e-4, 1e-4], [0, 1e-4, 2e-4]]
    np.testing.assert_allclose(matrix(roll(odometry.START, (1.0, 1.0))), expected, atol=1e-18)


def test_turning_in_place_loses_the_heading() -> None:
    """Half a radian: 2 * 0.25 m * 1e-4 from the travel, 0.5 rad * 3e-4 from scrubbing, makes 2e-4 rad2."""
    assert roll(odometry.START, (-0.25, 0.25)).covariance.hh == pytest.approx(2e-4)


def test_an_uncertain_heading_swings_the_way_ahead() -> None:
    """A heading known to 0.1 rad (1 sigma) is 0.2 m sideways after 2 m, when nothing else is uncertain."""
    heading_only = PoseCovariance(hh=0.01)
    state = roll(OdometryState(Pose2D(), STANDING, heading_only), (2.0, 2.0), params=EXACT)
    assert math.sqrt(state.covariance.yy) == pytest.approx(0.2)


def matrix(state: odometry.OdometryState) -> np.ndarray:
    """The covariance as a 3x3 array."""
    return np.reshape(state.covariance.row_by_row, (3, 3))


def sampled_covariance(left_m: float, right_m: float) -> np.ndarray:
    """The spread of the ends of 200 000 arcs whose sides and scrubbing are drawn from the noise model."""
    rng = np.random.default_rng(7)
    turned = right_m - left_m
    left = left_m + rng.normal(0, math.sqrt(1e-4 * abs(left_m)), 200_000)
    right = right_m + rng.normal(0, math.sqrt(1e-4 * abs(right_m)), 200_000)
    turn = right - left + rng.normal(0, math.sqrt(3e-4 * abs(turned)), 200_000)
    radius = (left + right) / 2 / turn
    return np.cov(np.stack([radius * np.sin(turn), radius * (1 - np.cos(turn)), turn]))


@pytest.mark.parametrize(("left_m", "right_m"), [(0.6, 1.0), (1.0, 0.2), (-0.5, -0.9)])
def test_the_covariance_is_the_spread_of_noisy_arcs(left_m: float, right_m: float) -> None:
    """First-order propagation along an arc agrees with sampling it, within a few percent of the largest term."""
    sampled = sampled_covariance(left_m, right_m)
    computed = matrix(roll(odometry.START, (left_m, right_m)))
    np.testing.assert_allclose(computed, sampled, atol=0.03 * np.abs(sampled).max())


travel = st.floats(-0.5, 0.5)


@given(st.lists(st.tuples(travel, travel), min_size=1, max_size=30))
@settings(max_examples=examples(60))
def test_covariance_stays_a_covariance(steps: list[tuple[float, float]]) -> None:
    """Symmetric to the last bit, no negative variance along any axis, the heading never surer."""
    state = odometry.START
    for step in steps:
        before, state = state, roll(state, step)
        assert state.covariance.hh >= before.covariance.hh
    assert np.linalg.eigvalsh(matrix(state)).min() >= -1e-12


def test_standing_still_changes_only_the_twist() -> None:
    """Without travel the pose and its certainty stay; the twist is the one given."""
    moved = roll(odometry.START, (0.5, 0.6))
    stood = integrate(PARAMS, TRACK_M, moved, 0.0, 0.0, Twist2D(0.1, 0.2))
    assert stood.odom_from_base == moved.odom_from_base
    assert stood.covariance is moved.covariance
    assert stood.twist == Twist2D(0.1, 0.2)


def test_setting_the_pose_makes_it_certain() -> None:
    """The pose is as given, its covariance zero, the twist still the last one."""
    moved = integrate(PARAMS, TRACK_M, odometry.START, 0.5, 0.6, Twist2D(0.3, 0.1))
    placed = odometry.set_pose(moved, Pose2D(1.0, 2.0, 3.0))
    assert pose_of(placed) == (1.0, 2.0, 3.0)
    assert placed.covariance == CERTAIN
    assert placed.twist == Twist2D(0.3, 0.1)


def test_a_pose_may_be_set_with_any_heading() -> None:
    """100 rad are 16 turns less 0.531 rad (100 - 32 pi), and the heading of a pose is in (-pi, pi]."""
    placed = odometry.set_pose(odometry.START, Pose2D(0.0, 0.0, 100.0))
    assert pose_of(placed) == (0.0, 0.0, pytest.approx(100 - 32 * math.pi))


NARROW_TRACK_M = 0.3
SOMEWHERE = OdometryState(
    Pose2D(1.2, -0.7, 2.3), STANDING, PoseCovariance(xx=4e-4, xy=-1e-4, xh=2e-4, yy=3e-4, yh=1e-4, hh=5e-4)
)


def end_of(
    x_m: float, y_m: float, heading_rad: float, left_m: float, right_m: float, scrub_rad: float
) -> np.ndarray:
    """The end of an arc in the complex plane, by its chord and not by its formula above; turned by scrubbing too."""
    turned_rad = (right_m - left_m) / NARROW_TRACK_M + scrub_rad
    way = (np.exp(1j * turned_rad) - 1) / (1j * turned_rad) * (left_m + right_m) / 2
    end = complex(x_m, y_m) + way * np.exp(1j * heading_rad)
    return np.array([end.real, end.imag, heading_rad + turned_rad])


@pytest.mark.parametrize(
    ("left_m", "right_m"),
    [(0.6, 1.0), (1.0, 0.2), (-0.5, -0.9), (-0.2, 0.35), (0.5, 0.5003), (-0.7, -0.69996)],
)
def test_the_covariance_is_carried_along_the_arc_from_anywhere(left_m: float, right_m: float) -> None:
    """F P F^T and what each side and the tyres add, with every derivative taken by differences of an arc's ends.

    The robot is 0.3 m wide, stands aslant and is not certain where; the last two arcs are as good as straight.
    """
    start = np.array([1.2, -0.7, 2.3, left_m, right_m, 0.0])
    step = 1e-4
    slopes = np.stack(
        [
            (end_of(*(start + step * axis)) - end_of(*(start - step * axis))) / (2 * step)
            for axis in np.eye(6)
        ],
        axis=1,
    )
    inputs = np.zeros((6, 6))
    inputs[:3, :3] = matrix(SOMEWHERE)
    turned_rad = (right_m - left_m) / NARROW_TRACK_M
    inputs[3:, 3:] = np.diag([1e-4 * abs(left_m), 1e-4 * abs(right_m), 3e-4 * abs(turned_rad)])
    state = integrate(PARAMS, NARROW_TRACK_M, SOMEWHERE, left_m, right_m, STANDING)
    np.testing.assert_allclose(matrix(state), slopes @ inputs @ slopes.T, rtol=1e-5, atol=2e-9)
    ends = end_of(*start)
    ends[2] = math.remainder(ends[2], math.tau)
    np.testing.assert_allclose(pose_of(state), ends, atol=1e-12)
