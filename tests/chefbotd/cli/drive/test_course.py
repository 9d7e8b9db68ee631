"""Steering along a square, with poses and speeds worked out by hand."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.cli.drive.course import (
    Deviation,
    GoTo,
    TurnTo,
    deviation,
    remaining_rad,
    slowing,
    square,
    steer,
)
from chefbotd.core.geometry import Pose2D, Twist2D
from tests.budget import examples

EAST_2M = GoTo(Pose2D(2.0, 0.0, 0.0))


def test_square_has_four_sides_and_four_left_turns() -> None:
    """The corners of a 2 m square lie to the left of the start, and the last turn restores the start."""
    legs = square(2.0)
    targets = [(round(t.x_m, 9), round(t.y_m, 9), round(math.degrees(t.heading_rad), 6)) for t in
               (leg.target for leg in legs)]  # fmt: skip
    assert [type(leg) for leg in legs] == [GoTo, TurnTo] * 4
    assert [tuple(map(abs, t)) for t in targets] == [
        (2, 0, 0), (2, 0, 90), (2, 2, 90), (2, 2, 180), (0, 2, 180), (0, 2, 90), (0, 0, 90), (0, 0, 0),
    ]  # fmt: skip
    assert targets[5][2] == -90


def test_far_from_the_corner_it_cruises_straight() -> None:
    """On the line and aligned, the speed is the cruising speed and nothing turns."""
    assert steer(EAST_2M, Pose2D()) == Twist2D(0.3, 0.0)


def test_it_slows_down_near_the_corner() -> None:
    """With 0.02 m to go and 0.25 m/s² the speed is sqrt(2 * 0.25 * 0.02) = 0.1 m/s."""
    twist = steer(EAST_2M, Pose2D(1.98, 0.0, 0.0))
    assert twist is not None
    assert twist.linear_m_s == pytest.approx(0.1)


def test_a_side_ends_level_with_its_corner() -> None:
    """Within the tolerance before the corner, or beyond it, the side is done."""
    assert steer(EAST_2M, Pose2D(1.9951)) is None
    assert steer(EAST_2M, Pose2D(2.1)) is None
    assert steer(EAST_2M, Pose2D(1.99)) is not None


@pytest.mark.parametrize(
    ("y_m", "heading_rad", "angular_rad_s"), [(0.1, 0.0, -0.4), (0.0, 0.1, -0.2), (-0.1, 0.2, 0.0)]
)
def test_it_steers_back_to_the_line(y_m: float, heading_rad: float, angular_rad_s: float) -> None:
    """Left of the line by y it wants a heading of -2 y, and turns at 2 /s times what is missing."""
    twist = steer(EAST_2M, Pose2D(0.0, y_m, heading_rad))
    assert twist is not None
    assert twist.angular_rad_s == pytest.approx(angular_rad_s)


def test_correction_is_bounded() -> None:
    """Far off the line it turns no faster than at a corner."""
    twist = steer(EAST_2M, Pose2D(0.0, 1.0, 0.0))
    assert twist is not None
    assert twist.angular_rad_s == -1.2


@pytest.mark.parametrize(("heading_deg", "degrees"), [(0.0, 90.0), (180.0, -90.0), (-89.0, 179.0)])
def test_it_turns_the_shorter_way(heading_deg: float, degrees: float) -> None:
    """To 90 degrees: to the left from 0 and -89, to the right from 180."""
    left = remaining_rad(TurnTo(Pose2D(0, 0, math.pi / 2)), Pose2D(5.0, 5.0, math.radians(heading_deg)))
    assert math.degrees(left) == pytest.approx(degrees)


@settings(max_examples=examples(50))
@given(st.floats(0, 10), st.floats(0, 10))
def test_slowing_is_monotone(one: float, other: float) -> None:
    """The further to go the faster, never below creeping or above cruising."""
    near, far = sorted((one, other))
    assert 0.03 <= slowing(near, 0.3, 0.03, 0.25) <= slowing(far, 0.3, 0.03, 0.25) <= 0.3


def follow(leg: GoTo, start: Pose2D, dt_s: float = 0.02) -> Pose2D:
    """A kinematic robot that does exactly as steered: its final pose, after a minute at most."""
    pose, elapsed_s = start, 0.0
    while (twist := steer(leg, pose)) is not None and elapsed_s < 60:
        pose = pose.compose(Pose2D(twist.linear_m_s * dt_s, 0.0, twist.angular_rad_s * dt_s))
        elapsed_s += dt_s
    return pose


@settings(max_examples=examples(20))
@given(st.floats(-0.1, 0.1), st.floats(-0.2, 0.2))
def test_it_recovers_from_a_skewed_start(y_m: float, heading_rad: float) -> None:
    """Starting 10 cm and 11 degrees off still ends near the first corner's line."""
    pose = follow(EAST_2M, Pose2D(0.0, y_m, heading_rad))
    assert abs(pose.y_m) < 0.02


def test_deviation_is_distance_and_heading() -> None:
    """A 3-4-5 triangle, and 179 to -179 degrees is 2 degrees."""
    apart = deviation(Pose2D(0, 0, math.radians(179)), Pose2D(3, 4, math.radians(-179)))
    assert apart == Deviation(5.0, pytest.approx(math.radians(2)))
    assert not apart.within(5.1, math.radians(1.9))
    assert apart.within(5.1, math.radians(2.1))
