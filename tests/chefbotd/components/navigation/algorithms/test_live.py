"""What was seen since the map was made: marked, cleared and forgotten."""

import math

import numpy as np
import pytest

from chefbotd.components.navigation.algorithms.grid import GridFrame
from chefbotd.components.navigation.algorithms.live import nothing_seen, obstacles_seen, see_range, see_scan
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.navigation.algorithms.grids import drawn

FRAME = GridFrame.of(drawn(*["." * 60] * 40))
FAR = np.full((40, 60), np.inf, np.float32)
SENSOR = np.array([0.51, 1.02])


def cells(live: object, now_s: float, fixed_m: np.ndarray = FAR) -> list[tuple[int, int]]:
    """The cells of the obstacles at a time."""
    points = obstacles_seen(live, fixed_m, now_s)
    return [(math.floor(y / 0.05), math.floor(x / 0.05)) for x, y in points]


def test_a_beam_marks_where_it_ended() -> None:
    """Seen from (0.51, 1.02), a chair's leg at (1.33, 1.41) is in row 28, column 26."""
    live = see_scan(nothing_seen(FRAME), FRAME, 5.0, SENSOR, np.array([[1.33, 1.41]]))
    assert cells(live, 5.0) == [(28, 26)]
    assert cells(nothing_seen(FRAME), 5.0) == []


def test_a_beam_clears_what_it_passes_and_nothing_behind_its_end() -> None:
    """Two things on one line: a beam that ends between them clears the nearer one only."""
    near, far, between = (SENSOR + np.array([away, 0.0]) for away in (0.5, 1.5, 1.0))
    live = see_scan(nothing_seen(FRAME), FRAME, 5.0, SENSOR, np.array([far]))
    live = see_scan(live, FRAME, 5.1, SENSOR + np.array([0.0, 0.3]), np.array([near]))
    live = see_scan(live, FRAME, 5.2, SENSOR, np.array([between]))
    assert sorted(cells(live, 5.2)) == [(20, 30), (20, 40)]


def test_each_beam_clears_the_way_from_its_own_lidar() -> None:
    """A leg between two lidars' beams stays; the beam that passes it from its own lidar clears it."""
    for wall_y_m, seen in ((1.92, [(12, 48), (28, 26), (38, 48)]), (1.41, [(12, 48), (28, 48)])):
        live = see_scan(nothing_seen(FRAME), FRAME, 5.0, SENSOR, np.array([[1.33, 1.41]]))
        walls, places = np.array([[2.42, 0.62], [2.42, wall_y_m]]), np.array([[0.5, 0.62], [0.5, wall_y_m]])
        assert sorted(cells(see_scan(live, FRAME, 5.1, places, walls), 5.1)) == seen


def test_a_scan_without_returns_clears_nothing() -> None:
    """Glass returns nothing: what stands there stays."""
    live = see_scan(nothing_seen(FRAME), FRAME, 5.0, SENSOR, np.array([[1.33, 1.41]]))
    assert cells(see_scan(live, FRAME, 5.1, SENSOR, np.zeros((0, 2))), 5.1) == [(28, 26)]


def test_a_beam_along_a_surface_does_not_clear_the_surface() -> None:
    """A wall seen under a small angle is marked as a whole, though the far beams pass its near cells."""
    wall = np.stack([np.linspace(0.8, 2.6, 40), np.full(40, 1.06)], axis=1)
    live = see_scan(nothing_seen(FRAME), FRAME, 5.0, SENSOR, wall)
    live = see_scan(live, FRAME, 5.1, SENSOR, wall)
    assert {column for _, column in cells(live, 5.1)} == set(range(16, 53))


def test_what_no_beam_passes_is_remembered_the_longer_the_longer_it_was_seen() -> None:
    """A glimpse for 4 s, five seconds of seeing for 20 s, a minute of seeing for a minute and no longer."""
    leg = np.array([[1.33, 1.41]])
    live = see_scan(nothing_seen(FRAME), FRAME, 5.0, SENSOR, leg)
    assert (len(cells(live, 8.9)), len(cells(live, 9.1))) == (1, 0)
    live = see_scan(live, FRAME, 10.0, SENSOR, leg)
    assert (len(cells(live, 29.9)), len(cells(live, 30.1))) == (1, 0)
    live = see_scan(live, FRAME, 65.0, SENSOR, leg)
    assert (len(cells(live, 124.9)), len(cells(live, 125.1))) == (1, 0)


def test_what_the_map_shows_already_is_no_live_obstacle() -> None:
    """A point 0.12 m or less from an obstacle of the map is that obstacle."""
    live = see_scan(nothing_seen(FRAME), FRAME, 5.0, SENSOR, np.array([[1.33, 1.41]]))
    fixed_m = FAR.copy()
    fixed_m[28, 26] = 0.11
    assert cells(live, 5.0, fixed_m) == []


def test_a_sonars_echo_marks_an_arc_that_fades_after_three_seconds() -> None:
    """At 0.8 m a cone of 0.26 rad is 0.21 m wide: five cells of 0.05 m, give or take one."""
    sensor = Pose2D(0.5, 1.0, 0.0)
    live = see_range(nothing_seen(FRAME), FRAME, FAR, 5.0, sensor, 0.81, 0.26)
    assert 4 <= len(cells(live, 5.0)) <= 6
    assert {column for _, column in cells(live, 5.0)} <= {25, 26}
    assert cells(live, 7.9) == cells(live, 5.0)
    assert cells(live, 8.1) == []


def test_a_lidars_beam_does_not_clear_what_a_sonar_heard() -> None:
    """It may be glass: the beam passes it, the sound does not."""
    live = see_range(nothing_seen(FRAME), FRAME, FAR, 5.0, Pose2D(0.5, 1.02, 0.0), 0.81, 0.26)
    heard = cells(live, 5.1)
    through = see_scan(live, FRAME, 5.1, SENSOR, np.array([[2.5, 1.02]]))
    assert set(heard) <= set(cells(through, 5.1))


def test_an_echo_that_map_or_lidar_explain_marks_nothing() -> None:
    """A door post in the cone must not close the whole door."""
    sensor = Pose2D(0.5, 1.0, 0.0)
    post = FAR.copy()
    post[22, 26] = 0.0
    assert cells(see_range(nothing_seen(FRAME), FRAME, post, 5.0, sensor, 0.81, 0.26), 5.0) == []
    leg = see_scan(nothing_seen(FRAME), FRAME, 5.0, SENSOR, np.array([[1.31, 1.08]]))
    assert cells(see_range(leg, FRAME, FAR, 5.0, sensor, 0.81, 0.26), 5.0) == cells(leg, 5.0)


@pytest.mark.parametrize("range_m", [0.0, -1.0, 1.6, math.nan, math.inf])
def test_an_echo_from_afar_or_from_nowhere_marks_nothing(range_m: float) -> None:
    """Beyond 1.5 m a cone is too wide, and what is no distance is no echo."""
    live = see_range(nothing_seen(FRAME), FRAME, FAR, 5.0, Pose2D(0.5, 1.0, 0.0), range_m, 0.26)
    assert cells(live, 5.0) == []
