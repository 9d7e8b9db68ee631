"""Which approaches count as ones where there was room."""

import math

import numpy as np
import pytest

from benchmarks.roominess import least_with_room_m
from chefbotd.components.navigation.algorithms.grid import distances_m
from tests.chefbotd.components.mapping.algorithms.slam.flat import wall
from tests.chefbotd.components.navigation.algorithms.drives import Clearance
from tests.chefbotd.components.navigation.algorithms.grids import rasterised, segment_distance_m

CELL_M, RADIUS_M = 0.025, 0.18


def least_m(gap_m: float, at_x_m: float, people: tuple[tuple[float, float], ...] = ()) -> float:
    """Straight through a gap in a thin wall at x = 2 m, 4 m high, whose right post is at y = 1.5 m, from x = 1 to 3 m.

    The robot passes with ``at_x_m`` between that post and its outline, slantwise before and after.
    """
    walls = np.vstack([wall((2.0, 0.0), (2.0, 1.5)), wall((2.0, 1.5 + gap_m), (2.0, 4.0))])
    room_m = distances_m(rasterised(walls, 4.0, 4.0, CELL_M).percent > 0, CELL_M)
    passed = []
    for x_m in np.arange(1.0, 3.0, 0.01):
        y_m = 1.5 + RADIUS_M + at_x_m + 0.3 * abs(x_m - 2.0)
        passed.append(Clearance(x_m, y_m, segment_distance_m(walls, x_m, y_m) - RADIUS_M, math.inf, people))
    return least_with_room_m(passed, room_m, CELL_M, RADIUS_M)


def test_who_grazes_a_post_of_a_wide_gap_had_room() -> None:
    """A gap of 0.9 m, the robot 0.36 m wide, 4 cm from one post: there were 0.5 m on the other side."""
    assert 0.03 < least_m(0.9, 0.04) < 0.045


def test_in_a_narrow_gap_there_is_no_room() -> None:
    """0.5 m less 0.36 m are 7 cm on either side: what is near there had to be, and the rest is 0.10 m or more."""
    assert least_m(0.5, 0.07) >= 0.10


def test_who_stands_in_a_wide_gap_leaves_no_room() -> None:
    """0.44 m across, in the left half of the gap of 0.9 m: 0.03 m are left beside the robot in the right half."""
    assert least_m(0.9, 0.04, ((2.0, 2.15),)) >= 0.10
    assert least_m(0.9, 0.04, ((3.5, 3.5),)) < 0.045


def test_who_keeps_clear_is_judged_by_what_he_keeps() -> None:
    """15 cm from the post of a wide gap, and nowhere nearer."""
    assert least_m(0.9, 0.15) == pytest.approx(0.15, abs=1e-6)
