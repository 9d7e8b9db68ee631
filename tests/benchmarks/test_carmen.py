"""Recordings are read as their README says, and scored by relations as the published metric has it."""

import gzip
import importlib.util
import json
import math
from pathlib import Path

import numpy as np
import pytest

if not importlib.util.find_spec("numba"):
    pytest.skip("needs the extra navigation", allow_module_level=True)

from benchmarks.carmen import recordings, score
from benchmarks.slam import run


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A recording of four rows and two scans (rows 0 and 2): one metre ahead each time, the last row turned left."""
    place = tmp_path / "hall"
    place.mkdir()
    (place / "meta.json").write_text(json.dumps({"beams": 3, "angle_min": -0.5, "angle_inc": 0.5}))
    odometry = "i,t,x,y,th\n0,0,0,0,0\n1,1,1,0,0\n2,2,2,0,0\n3,3,3,0,1.5707963\n"
    (place / "odom.csv.gz").write_bytes(gzip.compress(odometry.encode()))
    (place / "scans.csv").write_text("0,0.0,0,1.0,2.0,3.0\n1,2.0,2,1.5,2.5,81.83\n")
    (place / "relations.csv").write_text("i,j,x,y,th\n0,2,2.3,0.4,0\n1,3,2.0,0.0,1.5707963\n")
    return tmp_path


def test_a_recording_is_read(folder: Path) -> None:
    """Plain or gzipped, with the rows of its scans and the bearings of its beams."""
    (found,) = recordings(folder)
    assert (found.name, found.rows, found.is_official, found.is_dense) == ("hall", (0, 2), True, False)
    assert np.allclose(found.bearings_rad, [-0.5, 0, 0.5])
    assert found.ranges_m[1, 2] == 81.83
    assert np.allclose(found.odometry[3], [3, 0, math.pi / 2])


def test_errors_are_those_of_relations(folder: Path) -> None:
    """Told 2.3 m ahead and 0.4 m left where the trajectory has 2.0 m is 0.5 m off; rows between scans go by odometry.

    Row 3 lies a metre beyond row 2, which the trajectory has turned by a degree; so that relation is a degree off, and
    0.0175 m to the side. The trajectory's own frame, here moved and turned, does not matter.
    """
    (found,) = recordings(folder)
    turn, degree = 0.7, math.radians(1)
    poses = np.array([[5, 5, turn], [5 + 2 * math.cos(turn), 5 + 2 * math.sin(turn), turn + degree]])
    result = score(found, poses)
    assert result.relations == 2
    side_m = 2 * math.sin(degree / 2)
    assert result.translation_m == pytest.approx((0.5 + side_m) / 2, abs=1e-6)
    assert result.rotation_deg == pytest.approx(1.0, abs=1e-5)
    assert result.translation_max_m == pytest.approx(0.5)


@pytest.mark.slow
def test_without_recordings_the_benchmark_says_so(tmp_path: Path) -> None:
    """It drives through the flat, and names the folder that it looked in."""
    outcome = run(quick=True, folder=tmp_path)
    assert str(tmp_path) in outcome.remarks[-1]
    assert any(figure.name.startswith("flat, walls") and figure.reached for figure in outcome.figures)
