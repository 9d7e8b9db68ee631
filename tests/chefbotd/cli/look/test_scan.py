"""What `chefbotctl scan` draws and says."""

import json
import math

import pytest
from msgspec import convert

from chefbotd.cli.common.exits import Exit
from chefbotd.cli.look.view import caption, draw_scan, points_m, reach_of
from chefbotd.client.models import ScanData
from tests.chefbotd.cli.fake_daemon import FakeDaemon
from tests.chefbotd.conftest import Control

SCAN = {
    "lidar": "top",
    "x_m": 0.1,
    "y_m": 0.0,
    "yaw_rad": math.pi / 2,
    "bearing_start_rad": 0.0,
    "bearing_step_rad": -math.pi / 2,
    "bearing_mrad": None,
    "range_mm": [1000, 1500, 0, 700],
    "duration_s": 0.1,
}


def test_points_are_in_the_robot_s_frame() -> None:
    """The zero mark points left: 1 m left, then, clockwise, 1.5 m ahead, nothing at the right, 0.7 m behind.

    The lidar is 0.1 m ahead of the base.
    """
    found = points_m(convert(SCAN, ScanData))
    assert [(round(x, 6), round(y, 6)) for x, y in found] == [(0.1, 1.0), (1.6, 0.0), (-0.6, 0.0)]


def test_uneven_bearings_are_drawn_where_they_are() -> None:
    """In thousandths of a radian, each for itself."""
    uneven = {**SCAN, "bearing_step_rad": None, "bearing_mrad": [0, -1571, 100, 1571]}
    found = points_m(convert(uneven, ScanData))
    assert found[1] == pytest.approx((1.6, 0.0), abs=0.001)
    assert found[2] == pytest.approx((-0.6, 0.0), abs=0.001)


def test_the_picture_has_the_robot_in_the_middle_and_ahead_up() -> None:
    """At 1 m a character of 11 by 5: ahead is above the robot, left is left of it, and what is farther is not drawn."""
    lines = draw_scan([(0.8, 0.0), (0.0, 0.9), (5.0, 0.0)], 11, 5, 1.0).plain.splitlines()
    assert lines[2][5] == "▲"
    drawn = {
        (row, column) for row, line in enumerate(lines) for column, char in enumerate(line) if char > "\u2800"
    }
    assert drawn == {(0, 5), (2, 1)}


@pytest.mark.parametrize("size", [(1, 1), (3, 3), (200, 60)])
def test_any_terminal_is_drawn_on(size: tuple[int, int]) -> None:
    """However small."""
    assert "▲" in draw_scan([(0.5, 0.5)], *size, 1.0).plain


def test_the_scale_is_a_round_one_that_most_readings_fit() -> None:
    """Nine of ten are within 1.9 m, one at 11 m: 2 m; nothing seen: 1 m."""
    assert reach_of([(0.19 * n, 0.0) for n in range(1, 11)] + [(11.0, 0.0)]) == 2.0
    assert reach_of([]) == 1.0
    assert reach_of([(100.0, 0.0)]) == 24.0


def test_the_caption_tells_the_nearest_reading_and_its_side() -> None:
    """0.6 m behind; a scan without a reading has none."""
    scan = convert(SCAN, ScanData)
    told = caption(scan, points_m(scan), 2.0)
    for part in ("top", "3 of 4 beams", "100 ms", "0.60 m from the base, behind", "2 m"):
        assert part in told
    assert "nearest" not in caption(scan, [], 1.0)
    assert "ahead" in caption(scan, [(1.0, 0.001)], 1.0)
    assert "45° to the right" in caption(scan, [(1.0, -1.0)], 1.0)


def test_once_draws_one_scan_and_ends(control: Control, daemon: FakeDaemon) -> None:
    """The picture and the caption."""
    daemon.scan = SCAN
    result = control("scan", "--once")
    assert result.exit_code == 0
    assert "▲" in result.stdout
    assert "top: 3 of 4 beams" in " ".join(result.stdout.split())


def test_as_json_the_scan_is_told_as_it_is(control: Control, daemon: FakeDaemon) -> None:
    """One object, with the topic's data."""
    daemon.scan = SCAN
    (line,) = control("--json", "scan", "--once").stdout.splitlines()
    told = json.loads(line)
    assert told["topic"] == "scan"
    assert told["data"]["range_mm"] == [1000, 1500, 0, 700]


def test_another_reach_is_drawn(control: Control, daemon: FakeDaemon) -> None:
    """As asked for."""
    daemon.scan = SCAN
    assert "6.5 m to the edge" in " ".join(control("scan", "--once", "--reach", "6.5").stdout.split())


def test_a_robot_without_a_lidar_says_so(control: Control, daemon: FakeDaemon) -> None:
    """What to configure is said."""
    daemon.refuse["subscribe"] = "unknown_topic"
    result = control("scan", "--once")
    assert result.exit_code == Exit.FAILED
    assert "this robot has no lidar: its configuration has no [[lidar]]" in result.stderr


def test_a_lidar_that_is_not_heard_is_told_with_its_reason(control: Control, daemon: FakeDaemon) -> None:
    """After 5 s, with what the link says."""
    daemon.lidar_condition = "silent"
    result = control("scan")
    assert result.exit_code == Exit.FAILED
    assert "no scan within 5 s (top: silent, nothing received for 2.0 s)" in " ".join(result.stderr.split())


def test_a_lidar_of_another_name_is_not_waited_for_without_end(control: Control, daemon: FakeDaemon) -> None:
    """Its name, and those there are."""
    daemon.scan = SCAN
    result = control("scan", "--lidar", "low")
    assert result.exit_code == Exit.FAILED
    assert "no scan of 'low' within 5 s (top: healthy" in " ".join(result.stderr.split())


def test_an_old_scan_is_not_drawn(control: Control, daemon: FakeDaemon) -> None:
    """What comes first may be of minutes ago."""
    daemon.scan, daemon.age_s = SCAN, 2.0
    assert "no scan within 5 s" in " ".join(control("scan", "--once").stderr.split())


def test_a_depth_camera_without_a_lidar_that_sends_nothing_is_told(
    control: Control, daemon: FakeDaemon
) -> None:
    """It brings the topic of the scans, and there is nothing to say of lidars."""
    daemon.lidar_condition = ""
    result = control("scan", "--once")
    assert result.exit_code == Exit.FAILED
    assert "no scan within 5 s (this robot has no lidar, and a depth camera's images" in " ".join(
        result.stderr.split()
    )
