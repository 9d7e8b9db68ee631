"""A lidar's direction, by scans of an oblique room that are worked out here beam by beam."""

import math

import numpy as np
import pytest

from chefbotd.components.doctor.algorithms.finding import Verdict
from chefbotd.components.doctor.algorithms.lidar import (
    ScanTaken,
    check_ahead,
    check_lidar,
    check_motion,
    fit_motion,
)
from chefbotd.core.geometry import Pose2D

BEAMS = 240
CORNERS = ((2.1, -1.3), (1.6, 1.9), (-1.2, 1.4), (-2.6, -0.4), (-0.7, -1.8))
"""A room of five unequal walls, counter-clockwise, the robot within."""


def scan(
    at: Pose2D, *, believed_yaw_rad: float, real_yaw_rad: float, mirrored: bool = False, box: float = 0.0
) -> ScanTaken:
    """What a lidar on the robot's axis that points to ``real_yaw_rad`` sees; ``box`` is its distance ahead (0: none)."""
    bearings = np.arange(BEAMS) * math.tau / BEAMS
    ranges = []
    for bearing in bearings:
        ahead_rad = real_yaw_rad + (-bearing if mirrored else bearing)
        ranges.append(_nearest_wall_m(at, at.heading_rad + ahead_rad))
        if box and abs(math.remainder(ahead_rad, math.tau)) < 0.15:
            ranges[-1] = min(ranges[-1], box)
    return ScanTaken(Pose2D(0.0, 0.0, believed_yaw_rad), tuple(bearings.tolist()), tuple(ranges))


def _nearest_wall_m(at: Pose2D, direction_rad: float) -> float:
    dx, dy = math.cos(direction_rad), math.sin(direction_rad)
    found = []
    for (ax, ay), (bx, by) in zip(CORNERS, (*CORNERS[1:], CORNERS[0]), strict=True):
        wx, wy = bx - ax, by - ay
        if abs(det := dx * wy - dy * wx) < 1e-12:
            continue
        far = ((ax - at.x_m) * wy - (ay - at.y_m) * wx) / det
        along = ((ax - at.x_m) * dy - (ay - at.y_m) * dx) / det
        if far > 0 and 0 <= along <= 1:
            found.append(far)
    return min(found)


FORWARD, LEFT_TURN = Pose2D(0.3, 0.01, 0.03), Pose2D(0.0, 0.0, 1.4)


@pytest.mark.parametrize("real", [0.7, 0.7 + math.pi, 0.7 - math.pi / 2], ids=["right", "half", "quarter"])
def test_a_drive_forward(real: float):
    """The direction in which the walls come nearer tells where the lidar looks; believed is 0.7 rad."""
    before = scan(Pose2D(), believed_yaw_rad=0.7, real_yaw_rad=real)
    after = scan(FORWARD, believed_yaw_rad=0.7, real_yaw_rad=real)
    fit = fit_motion(before, after, FORWARD)
    assert abs(math.remainder(fit.offset_rad - (real - 0.7), math.tau)) <= math.radians(10)
    expected = Verdict.OK if real == 0.7 else Verdict.PROBLEM
    assert check_motion("lidar", before, after, FORWARD).verdict is expected


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_turn_to_the_left(mirrored: bool):
    """A room that turns along tells a lidar that is mounted the other way up."""
    before = scan(Pose2D(), believed_yaw_rad=0.7, real_yaw_rad=0.7, mirrored=mirrored)
    after = scan(LEFT_TURN, believed_yaw_rad=0.7, real_yaw_rad=0.7, mirrored=mirrored)
    finding = check_motion("lidar", before, after, LEFT_TURN)
    assert finding.verdict is (Verdict.PROBLEM if mirrored else Verdict.OK)


def test_no_motion_tells_nothing():
    """Two scans from one place fit whatever the mount."""
    taken = scan(Pose2D(), believed_yaw_rad=0.7, real_yaw_rad=0.7)
    assert check_motion("lidar", taken, taken, Pose2D(0.02, 0.0, 0.0)).verdict is Verdict.SKIPPED


def test_a_box_ahead():
    """It appears ahead where the mount is right, and behind where the lidar is turned by half."""
    for real, verdict in ((0.7, Verdict.OK), (0.7 + math.pi, Verdict.PROBLEM)):
        before = scan(Pose2D(), believed_yaw_rad=0.7, real_yaw_rad=real)
        after = scan(Pose2D(), believed_yaw_rad=0.7, real_yaw_rad=real, box=0.5)
        assert check_ahead("lidar", before, after, 0.5).verdict is verdict
    assert "wrong way round" in check_ahead("lidar", before, after, 0.5).advice
    assert check_ahead("lidar", before, before, 0.5).verdict is Verdict.WARNING


def test_somebody_who_walks_by_farther_off_is_no_box():
    """What appears 1.2 m away is not what was placed at half a metre."""
    before = scan(Pose2D(), believed_yaw_rad=0.7, real_yaw_rad=0.7)
    after = scan(Pose2D(), believed_yaw_rad=0.7, real_yaw_rad=0.7, box=1.2)
    assert check_ahead("lidar", before, after, 0.5).verdict is Verdict.WARNING


def test_a_lidars_link():
    """Its own condition is passed on; one that is healthy and sends nothing is none."""
    assert check_lidar("lidar", "healthy", "", 10.0, 0.8).verdict is Verdict.OK
    assert check_lidar("lidar", "healthy", "", 10.0, 0.1).verdict is Verdict.WARNING
    assert check_lidar("lidar", "healthy", "", 0.0, 0.0).verdict is Verdict.PROBLEM
    stalled = check_lidar("lidar", "motor_stalled", "does its motor turn?", 0.0, 0.0)
    assert stalled.verdict is Verdict.PROBLEM
    assert "motor stalled: does its motor turn?" in stalled.measured
