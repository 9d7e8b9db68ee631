"""Odometry and scans put together: covariances by hand, and what a bare wall does not tell."""

import math

import numpy as np
import pytest

from chefbotd.components.localization.algorithms.state import Localization, Odometry, carry_estimate
from chefbotd.components.localization.algorithms.tracking import (
    LASER_NOISE_M,
    MAP_SIGMA_M,
    PoseEstimate,
    fuse_match,
    predict_pose,
    sigmas,
)
from chefbotd.components.mapping.algorithms.refine import Fit
from chefbotd.core.poses import motion_covariance


def test_what_is_uncertain_grows_with_the_way() -> None:
    """Four metres straight ahead at 0.1 m for the root of a metre: 0.2 m, and what the heading adds across."""
    last = PoseEstimate(np.array([1.0, 2.0, math.pi / 2]), np.diag([0.0, 0.0, 0.01]))
    found = predict_pose(last, np.array([4.0, 0.0, 0.0]))
    assert found.pose == pytest.approx([1.0, 6.0, math.pi / 2])
    assert found.covariance[1, 1] == pytest.approx(0.04)
    assert found.covariance[0, 0] == pytest.approx(0.04 + 16 * 0.01)
    assert found.covariance[2, 2] == pytest.approx(0.01 + 0.0025 * 4)


def test_standing_adds_nothing() -> None:
    """A robot that stands for an hour is as sure as before."""
    last = PoseEstimate(np.array([1.0, 2.0, 0.4]), np.diag([0.01, 0.02, 0.003]))
    found = predict_pose(last, np.zeros(3))
    assert (found.covariance == last.covariance).all()


def test_the_odometry_s_own_covariance_is_used_in_the_robot_s_frame() -> None:
    """Odometry says 0.03 m ahead and 0.01 m across; its frame is turned by 90 degrees to that of the map."""
    before = np.array([5.0, 5.0, math.pi / 2])
    after = np.array([5.0, 5.5, math.pi / 2])
    told = np.diag([0.2, 0.3, 0.0])
    noise = motion_covariance(before, told, after, told + np.diag([0.01**2, 0.03**2, 0.0]))
    assert noise is not None
    assert np.diag(noise) == pytest.approx([0.03**2, 0.01**2, 0.0])
    last = PoseEstimate(np.array([0.0, 0.0, 0.0]), np.zeros((3, 3)))
    assert predict_pose(last, np.array([0.5, 0, 0]), noise).covariance[0, 0] == pytest.approx(0.03**2)


def test_odometry_that_doubts_itself_makes_the_pose_less_certain_and_never_more() -> None:
    """Two metres ahead: 0.5 m by a slip counts, and 1 mm by odometry that knows of none does not."""
    start = Localization(
        estimate=PoseEstimate(np.zeros(3), np.zeros((3, 3))), odometry=Odometry(np.zeros(3), np.zeros((3, 3)))
    )
    after = np.array([2.0, 0.0, 0.0])

    def sigma_m(covariance: np.ndarray | None) -> float:
        estimate = carry_estimate(start, Odometry(after, covariance)).estimate
        assert estimate is not None
        return float(np.sqrt(estimate.covariance[0, 0]))

    assert sigma_m(np.diag([0.25, 0.25, 0.0])) == pytest.approx(0.5)
    assert sigma_m(np.diag([1e-6, 1e-6, 0.0])) == sigma_m(None)


def test_odometry_that_jumps_is_not_believed() -> None:
    """Nobody drives 7 m between two scans."""
    last = PoseEstimate(np.array([1.0, 2.0, 0.4]), np.diag([0.01, 0.01, 0.01]))
    assert predict_pose(last, np.array([5.0, 5.0, 0.0])) is last


def test_the_largest_sigma_is_that_of_the_longest_axis() -> None:
    """0.5 m along 30 degrees and 0.1 m across it: the largest is 0.5 m, whatever the axes."""
    cos, sin = math.cos(math.radians(30)), math.sin(math.radians(30))
    by = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    assert sigmas(by @ np.diag([0.25, 0.01, 0.04]) @ by.T) == pytest.approx((0.5, 0.2))


def test_a_wall_corrects_across_itself_only() -> None:
    """The match is 0.1 m off in both; 200 beams on a wall along x tell y, and of x only what noisy normals pretend."""
    per_beam = LASER_NOISE_M**-2
    information = np.diag([200 * per_beam * math.sin(0.05) ** 2, 200 * per_beam, 200 * per_beam])
    expected = PoseEstimate(np.array([3.0, 4.0, 0.0]), np.diag([0.04, 0.04, 0.01]))
    fit = Fit(np.array([3.1, 4.1, 0.0]), information, 200, 200, 200, 0, 0.01)
    found = fuse_match(expected, fit, np.linalg.inv(expected.covariance))
    assert found.pose[:2] == pytest.approx([3.0, 4.1], abs=0.002)
    assert math.sqrt(found.covariance[0, 0]) == pytest.approx(0.2, abs=0.001)
    assert math.sqrt(found.covariance[1, 1]) == pytest.approx(MAP_SIGMA_M, abs=0.002)
