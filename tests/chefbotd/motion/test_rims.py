"""Rims on ramps of their own."""

import math

import pytest

from chefbotd.core.geometry import Twist2D
from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.rims import alike, approach, pace_s, progress, share_of

LIMITS = MotionLimits.model_validate(
    {
        "linear": {"max_forward_m_s": 0.4, "acceleration_m_s2": 1.0, "deceleration_m_s2": 2.0},
        "angular": {"max_left_rad_s": 1.0, "acceleration_rad_s2": 5.0},
    }
)


@pytest.mark.parametrize(
    ("speeds_m_s", "twist", "share"),
    [
        ((0.0, 0.0), Twist2D(), 1.0),
        ((0.4, 0.4), Twist2D(0.4, 0.0), 1.0),
        ((0.25, -1.0), Twist2D(-0.375, 0.5), 0.5),  # a rim of 0.5 m/s is the most
        ((0.5, 0.5), Twist2D(0.5, 0.0), 0.8),  # the robot may go 0.4 m/s
        ((-0.3, 0.3), Twist2D(0.0, 4.0), 0.25),  # and turn at 1 rad/s
    ],
)
def test_the_tightest_limit_slows_all_wheels(speeds_m_s: tuple[float, ...], twist: Twist2D, share: float):
    """What the rims reach, how fast the robot may go, how fast it may turn."""
    assert share_of(LIMITS, 0.5, speeds_m_s, twist) == pytest.approx(share)


def test_the_rim_that_needs_most_sets_the_pace():
    """0.4 m/s up at 1 m/s2 are 0.4 s, 0.4 m/s down at 2 m/s2 are 0.2 s; no way takes no time."""
    assert pace_s(LIMITS.linear.axis, (0.0, 0.4, 0.1), (0.4, 0.0, 0.1)) == pytest.approx(0.4)
    assert pace_s(LIMITS.linear.axis, (0.0, 0.4), (0.0, 0.4)) == 0.0


@pytest.mark.parametrize(
    ("after", "share"),
    [
        (Twist2D(0.1, 0.5), 0.25),  # a quarter of the turning, which has more to go
        (Twist2D(0.4, 2.0), 1.0),
        (Twist2D(0.0, -0.5), 0.0),  # the other way: none
    ],
)
def test_progress_is_the_share_of_the_way_to_the_aim(after: Twist2D, share: float):
    """From rest to 0.4 m/s and 2 rad/s."""
    assert progress(Twist2D(), after, Twist2D(0.4, 2.0)) == pytest.approx(share)
    assert progress(Twist2D(0.4, 2.0), Twist2D(0.4, 2.0), Twist2D(0.4, 2.0)) == 1.0


def test_rims_approach_their_aims_and_reach_them_exactly():
    """A quarter of the way, and all of it."""
    assert approach((0.0, 0.4), (0.4, 0.0), 0.25) == pytest.approx((0.1, 0.3))
    assert approach((0.1, 0.2), (0.3, 0.0), 1.0) == (0.3, 0.0)


def test_rims_are_alike_as_far_as_numbers_are():
    """A rounding error is no difference, a micrometre a second is."""
    assert alike((0.1 + 0.2, 1.0), (0.3, math.nextafter(1.0, 2.0)))
    assert not alike((0.1, 0.2), (0.1, 0.2 + 1e-6))
