"""Pose arithmetic, against hand-made numbers and against core.geometry."""

import math

import numpy as np

from chefbotd.core.geometry import Pose2D
from chefbotd.core.poses import between, compose, inverse, transform, turn_covariance, wrap


def test_a_quarter_turn_composes_as_by_hand() -> None:
    """One metre ahead of a robot at (2, 3) that looks left is (2, 4)."""
    found = compose(np.array([2.0, 3.0, math.pi / 2]), np.array([1.0, 0.0, 0.25]))
    assert np.allclose(found, [2.0, 4.0, math.pi / 2 + 0.25])


def test_many_poses_are_composed_as_geometry_composes_each() -> None:
    """Rows agree with Pose2D at oblique angles, and between undoes compose."""
    a, b = np.array([0.7, -1.9, 2.6]), np.array([[0.3, 0.4, 1.1], [-2.0, 0.6, -0.4]])
    for row, found in zip(b, compose(a, b), strict=True):
        expected = Pose2D(*a).compose(Pose2D(*row))
        assert np.allclose(found, [expected.x_m, expected.y_m, expected.heading_rad])
    assert np.allclose(between(a, compose(a, b)), b)
    assert np.allclose(compose(a, inverse(a)), 0)


def test_points_are_carried_along() -> None:
    """A point one metre to the left of a robot at (1, 1) that looks back is at (1, 0)."""
    assert np.allclose(transform(np.array([1.0, 1.0, math.pi]), np.array([[0.0, 1.0]])), [[1.0, 0.0]])


def test_headings_wrap() -> None:
    """Three quarters left are one quarter right."""
    assert np.allclose(wrap(np.array([1.5 * math.pi, -1.5 * math.pi])), [-0.5 * math.pi, 0.5 * math.pi])


def test_an_uncertainty_ahead_turns_with_the_robot() -> None:
    """2 m ahead and 1 m across, of a robot that looks left, are 2 m along y; at 30 degrees they are mixed by hand."""
    ahead = np.diag([4.0, 1.0, 0.5])
    assert np.allclose(turn_covariance(ahead, math.pi / 2), np.diag([1.0, 4.0, 0.5]))
    oblique = turn_covariance(ahead, math.pi / 6)
    assert np.allclose(
        oblique[:2, :2], [[4 * 0.75 + 0.25, 3 * math.sqrt(0.75) / 2], [3 * math.sqrt(0.75) / 2, 1.75]]
    )
