"""A lidar's turn and its points on the robot, without its motion; and turns of several lidars, joined to one scan."""

import math

import numpy as np
import pytest

from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import Pose2D
from chefbotd.core.scan import LaserScan
from chefbotd.perception.laser_scan import (
    OdometryTrack,
    ScanAssembler,
    joined_points,
    points_in_base,
    pose_at,
    usable,
)

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


def fed(turns: list[tuple[str, float]], *lidars: str) -> list[tuple[str, ...]]:
    """The scans of these turns, of lidar and time: each turn is told as ``front@1.1``."""
    assembler: ScanAssembler[str] = ScanAssembler(lidars)
    scans = [assembler.add_turn(name, at_s, f"{name}@{at_s:g}") for name, at_s in turns]
    return [scan for scan in scans if scan]


def test_each_turn_of_the_leading_lidar_takes_the_others_newest_along() -> None:
    """The front one leads; what the rear one measured twice meanwhile is taken once, the newer turn."""
    turns = [("front", 1.0), ("rear", 1.04), ("front", 1.1), ("rear", 1.12), ("rear", 1.18), ("front", 1.2)]
    assert fed(turns, "front", "rear") == [
        ("front@1",), ("front@1.1", "rear@1.04"), ("front@1.2", "rear@1.18"),
    ]  # fmt: skip


def test_a_slow_lidar_is_taken_along_once_a_turn() -> None:
    """An RPLIDAR of 5.5 turns a second beside an LD19 of ten: no turn of it is used twice."""
    turns = [("ld", 1.0), ("rp", 1.03), ("ld", 1.1), ("ld", 1.2), ("rp", 1.21), ("ld", 1.3)]
    assert fed(turns, "ld", "rp") == [("ld@1",), ("ld@1.1", "rp@1.03"), ("ld@1.2",), ("ld@1.3", "rp@1.21")]


def test_where_the_leading_lidar_falls_silent_the_next_one_leads() -> None:
    """Half a second after its last turn, and until it is back; what waited for it has become too old."""
    rear = [("rear", 1.05 + 0.1 * k) for k in range(7)]
    turns = [("front", 1.0), *rear, ("front", 1.7), ("rear", 1.75), ("front", 1.8)]
    assert fed(turns, "front", "rear") == [
        ("front@1",), ("rear@1.55",), ("rear@1.65",), ("front@1.7",), ("front@1.8", "rear@1.75"),
    ]  # fmt: skip


def test_a_lidar_that_is_silent_holds_up_nothing() -> None:
    """The rear one never comes: each turn of the front one is a scan at once."""
    assert fed([("front", 1.0), ("front", 1.1)], "front", "rear") == [("front@1",), ("front@1.1",)]


def test_old_turns_and_other_lidars_are_left_out() -> None:
    """More than 0.3 s apart is not one scan; a lidar that is not asked for is passed over."""
    turns = [("front", 1.0), ("rear", 1.05), ("top", 1.1), ("front", 1.4)]
    assert fed(turns, "front", "rear") == [("front@1",), ("front@1.4",)]


@pytest.mark.parametrize("wrong_s", [math.nan, math.inf, 1e18, -1e18])
def test_a_turn_of_a_wrong_time_leads_nobody_astray(wrong_s: float) -> None:
    """One turn with a time that is none, from either lidar: afterwards scans are as before."""
    for wrong in ("front", "rear"):
        turns = [
            ("front", 1.0),
            (wrong, wrong_s),
            ("rear", 1.05),
            ("front", 1.1),
            ("rear", 1.15),
            ("front", 1.2),
        ]
        assert fed(turns, "front", "rear")[-1] == ("front@1.2", "rear@1.15")


def test_points_of_both_are_where_the_robot_stands_at_the_first_ones_time() -> None:
    """The robot drove 0.2 m ahead and turned left by a quarter between the rear turn and the front one.

    The rear lidar, 0.1 m behind the middle, looks back and saw a post 1 m behind itself: at x -1.1 of the robot then.
    The robot now is 0.2 m further and looks left, so the post is 1.3 m to its left; it was seen from 0.3 m to its left.
    """
    rear = one_beam(9.96, Pose2D(-0.1, 0.0, math.pi), 0.0, 1.0)
    front = one_beam(10.0, Pose2D(0.15, 0.05, 0.0), 0.0, 2.0)
    track = OdometryTrack(np.array([9.96, 10.0]), np.array([[0.0, 0.0, 0.0], [0.2, 0.0, math.pi / 2]]))
    points_m, sensor_m = joined_points((0.05, 30.0), [front, rear], track)
    assert np.allclose(points_m, [[2.15, 0.05], [0.0, 1.3]])
    assert np.allclose(sensor_m, [[0.15, 0.05], [0.0, 0.3]])


def test_one_lidar_alone_has_one_place() -> None:
    """As without the others: the mount's place for all points."""
    turn = one_beam(5.0, Pose2D(0.1, -0.2, 0.3), -0.3, 1.0)
    points_m, sensor_m = joined_points((0.05, 30.0), [turn], STILL)
    assert np.allclose(points_m, [[1.1, -0.2]])
    assert sensor_m.tolist() == [0.1, -0.2]


def one_beam(stamp_s: float, mount: Pose2D, bearing_rad: float, range_m: float) -> ScanMeasured:
    """A turn with a single reading."""
    scan = LaserScan(stamp_s, np.array([bearing_rad]), np.array([range_m]), np.zeros(1))
    return ScanMeasured(stamp_s, "lidar", mount, scan)
