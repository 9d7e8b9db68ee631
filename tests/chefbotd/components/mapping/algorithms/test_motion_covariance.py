"""The covariance of a motion, as the difference of two of odometry's."""

import math

import numpy as np
import pytest

from chefbotd.core.poses import carried_covariance, motion_covariance


def test_no_variance_is_below_zero_whatever_was_rounded() -> None:
    """10,000 motions that add next to nothing to a large covariance: each root can be taken."""
    rng = np.random.default_rng(1)
    for _ in range(10_000):
        root = rng.normal(size=(3, 3)) * 10 ** rng.uniform(-3, 3)
        before, after = rng.normal(size=3) * 10, rng.normal(size=3) * 10
        covariance = root @ root.T
        carried = carried_covariance(covariance, after[0] - before[0], after[1] - before[1])
        noise = motion_covariance(before, covariance, after, carried - np.diag(rng.uniform(0, 1e-12, 3)))
        if noise is not None:
            assert all(math.sqrt(noise[k, k]) >= 0.0 for k in range(3))


def test_a_motion_adds_what_it_adds() -> None:
    """Straight on along x with a heading known exactly: 0.04 m2 more ahead are 0.04 m2 along the robot's own x."""
    before, after = np.array([0.0, 0.0, math.pi / 2]), np.array([0.0, 1.0, math.pi / 2])
    noise = motion_covariance(before, np.diag([0.01, 0.01, 0.0]), after, np.diag([0.01, 0.05, 0.0]))
    assert noise is not None
    assert noise == pytest.approx(np.diag([0.04, 0.0, 0.0]), abs=1e-12)


def test_what_is_no_number_is_no_covariance() -> None:
    """Nor is one that has shrunk."""
    zero = np.zeros(3)
    with np.errstate(invalid="ignore"):
        assert motion_covariance(zero, np.eye(3), zero, np.diag([0.5, 1.0, 1.0])) is None
