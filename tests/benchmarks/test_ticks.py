"""Reading recordings, and plain integration by hand-computed arcs."""

import gzip
import json
import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.ticks import Geometry, apart, integrate, read_geometry, read_runs
from chefbotd.core.geometry import Pose2D

QUARTER = Geometry(wheel_diameter_m=1 / math.pi, wheel_base_m=1.0, ticks_per_revolution=1000, cycle_s=0.05)
"""A tick is a millimetre."""


def test_a_quarter_turn_about_the_standing_left_wheel() -> None:
    """Track 1 m, left still, right rolls pi/2 m in 100 equal steps: the pose is (0.5, 0.5, 90 degrees)."""
    right = np.diff(np.round(np.linspace(0, 1570.796, 101)))
    pose = integrate(QUARTER, np.column_stack((np.zeros(100), right)).astype(np.int64))
    assert (pose.x_m, pose.y_m, pose.heading_rad) == pytest.approx((0.5, 0.5, math.pi / 2), abs=3e-4)


def test_straight_ahead_is_the_sum_of_the_ticks() -> None:
    """Three times 200 ticks of a millimetre are 0.6 m, with no turn to divide by."""
    pose = integrate(QUARTER, np.full((3, 2), 200))
    assert pose.x_m == pytest.approx(0.6)
    assert (pose.y_m, pose.heading_rad) == (0.0, 0.0)


def test_apart_measures_the_short_way_round() -> None:
    """3 and 4 make 5 m; 179 degrees and -179 degrees are 2 degrees apart."""
    one, other = Pose2D(0, 0, math.radians(179)), Pose2D(3, 4, math.radians(-179))
    assert apart(one, other) == pytest.approx((5.0, math.radians(2)))


def test_a_recording_is_read_with_its_geometry(tmp_path: Path) -> None:
    """Ticks stay whole numbers, columns are found by name, the truth is the last row's pose."""
    values = {
        "wheel_diameter_m": 0.084,
        "wheel_base_m": 0.2,
        "ticks_per_wheel_revolution": 2796.8,
        "cycle_s": 0.05,
    }
    (tmp_path / "geometry.json").write_text(json.dumps(values))
    rows = "t_s,left_ticks,right_ticks,gt_x_m,gt_y_m,gt_yaw_rad\n0,0,0,0,0,0\n0.05,3,-4,0.5,0.25,7.5\n"
    (tmp_path / "square_1_run-01.csv.gz").write_bytes(gzip.compress(rows.encode()))
    assert read_geometry(tmp_path) == Geometry(0.084, 0.2, 2796.8, 0.05)
    (run,) = read_runs(tmp_path)
    assert (run.name, run.kind, run.ticks.tolist(), run.truth) == (
        "square_1_run-01",
        "square_1",
        [[0, 0], [3, -4]],
        Pose2D(0.5, 0.25, 7.5),
    )
