"""A lidar's turn: which beams are used, where they are on the robot, and the motion during the turn undone."""

import math

import numpy as np
import pytest

from chefbotd.core.geometry import Pose2D
from chefbotd.core.scan import LaserScan
from chefbotd.perception.laser_scan import OdometryTrack, points_in_base, pose_at, usable

BAND_M = (0.05, 30.0)
STILL = OdometryTrack(np.array([0.0]), np.zeros((1, 3)))
MOUNT = Pose2D(0.1, -0.05, 0.4)


def scan(bearings: list[float], ranges: list[float], after_s: list[float] | None = None) -> LaserScan:
    """A turn at 10 s."""
    times = after_s or [0.0] * len(ranges)
    return LaserScan(10.0, np.array(bearings), np.array(ranges), np.array(times))


def test_beams_without_a_reading_are_left_out() -> None:
    """Zero, infinity and NaN are no readings; too near and too far is not trusted."""
    ranges = [0.0, math.inf, math.nan, 0.09, 0.1, 8.0, 8.1, 2.0]
    assert usable((0.1, 8.0), scan([0.1 * k for k in range(8)], ranges)).tolist() == [
        False, False, False, False, True, True, False, True,
    ]  # fmt: skip


def test_a_veil_between_an_edge_and_the_wall_behind_is_left_out() -> None:
    """The middle one of 1.0, 1.6 and 2.4 m lies in mid-air; a lone post before the wall does not."""
    bearings = [0.01 * k for k in range(5)]
    assert usable(BAND_M, scan(bearings, [1.0, 1.0, 1.6, 2.4, 2.4])).tolist() == [
        True, True, False, True, True,
    ]  # fmt: skip
    assert usable(BAND_M, scan(bearings, [2.4, 2.4, 1.0, 2.4, 2.4])).all()


def test_points_are_where_the_mount_puts_them() -> None:
    """A lidar at (0.1, -0.05), turned 0.4: its beam at -0.4 of 2 m runs straight ahead, to (2.1, -0.05)."""
    found = points_in_base(BAND_M, MOUNT, scan([-0.4, math.pi / 2 - 0.4], [2.0, 1.0]), STILL)
    assert np.allclose(found, [[2.1, -0.05], [0.1, 0.95]])


def test_the_motion_during_a_turn_is_undone() -> None:
    """Turning by 1 rad/s and driving 0.3 m/s, a post 2 m ahead is seen at the same place by each beam."""
    times = np.linspace(9.9, 10.0, 11)
    turned = times - 9.9
    arc = np.stack([0.3 * np.sin(turned), 0.3 * (1 - np.cos(turned)), turned], axis=1)
    post = np.array([2.0, 0.1])
    dx, dy = (post - arc[:, :2]).T
    bearings, ranges = np.arctan2(dy, dx) - arc[:, 2], np.hypot(dx, dy)
    turn = LaserScan(10.0, bearings, ranges, times - 10.0)
    found = points_in_base(BAND_M, Pose2D(), turn, OdometryTrack(times, arc))
    assert np.ptp(found, axis=0).max() < 1e-9
    raw = points_in_base(BAND_M, Pose2D(), turn, OdometryTrack(times[-1:], arc[-1:]))
    assert np.ptp(raw[:, 1]) > 0.15


def test_headings_are_interpolated_over_the_back() -> None:
    """Halfway between 3.1 and -3.1 rad is straight behind, not ahead."""
    track = OdometryTrack(np.array([0.0, 1.0]), np.array([[0, 0, 3.1], [1, 0, -3.1]]))
    found = pose_at(track, np.array([0.5, -1.0, 2.0]))
    assert found[0] == pytest.approx([0.5, 0, math.pi])
    assert found[1] == pytest.approx([0, 0, 3.1])
    assert found[2] == pytest.approx([1, 0, math.tau - 3.1])


def test_bad_input_is_named() -> None:
    """Arrays of different lengths."""
    with pytest.raises(ValueError, match="of one length"):
        LaserScan(0.0, np.zeros(3), np.zeros(2), np.zeros(3))
