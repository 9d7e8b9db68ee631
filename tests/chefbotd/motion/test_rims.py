"""Rims on ramps of their own."""

import math

import pytest

from chefbotd.core.geometry import Twist2D
from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.rims import alike, ramp, share_of

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


def test_each_rim_keeps_the_acceleration_limits():
    """In 0.1 s: 0.1 m/s up, 0.2 m/s down, and no farther than the aim."""
    speeds, rates = ramp(LIMITS.linear.axis, (0.0, 0.4, 0.1), (0.0,) * 3, (0.4, 0.0, 0.12), 0.1)
    assert speeds == pytest.approx((0.1, 0.2, 0.12))
    assert rates == pytest.approx((1.0, -2.0, 0.2))


def test_no_time_changes_nothing():
    """Not even the accelerations."""
    assert ramp(LIMITS.linear.axis, (0.1,), (0.5,), (0.4,), 0.0) == ((0.1,), (0.5,))


def test_rims_are_alike_as_far_as_numbers_are():
    """A rounding error is no difference, a micrometre a second is."""
    assert alike((0.1 + 0.2, 1.0), (0.3, math.nextafter(1.0, 2.0)))
    assert not alike((0.1, 0.2), (0.1, 0.2 + 1e-6))
