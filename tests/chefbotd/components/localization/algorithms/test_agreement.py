"""How a scan agrees with a map, counted beam by beam by hand."""

import math

import numpy as np
import pytest

from chefbotd.components.localization.algorithms.agreement import Agreement, agreement
from chefbotd.components.localization.algorithms.surface_map import surface_map
from chefbotd.components.mapping.algorithms.local_map import LocalMap
from chefbotd.components.mapping.algorithms.state import Scan
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.poses import Floats

HERE = np.array([-1.0, 0.3, 0.4])
FACING_BACK = -HERE[2]


@pytest.fixture(scope="module")
def grids() -> LocalMap:
    """A wall 0.1 m thick along x = 0 with free space of 3 m on either side, and nothing known beyond."""
    middle = (np.arange(200) + 0.5) * 0.05 - 5
    x = np.broadcast_to(middle, (200, 200))
    percent = np.where(np.abs(x) > 3, -1, np.where(np.abs(x) < 0.05, 100, 0)).astype(np.int8)
    grid = OccupancyGrid(0.05, Pose2D(-5, -5), percent)
    return surface_map(grid, depth_cells=0).grids


def beams(*ends: tuple[float, float], normal: tuple[float, float] = (-1.0, 0.0)) -> Scan:
    """A scan taken at HERE that ends at these points of the map, on surfaces that face this way."""
    cos, sin = math.cos(HERE[2]), math.sin(HERE[2])
    turn: Floats = np.array([[cos, -sin], [sin, cos]])
    points = (np.array(ends) - HERE[:2]) @ turn
    facing = np.tile(np.array(normal) @ turn, (len(ends), 1))
    return Scan(points.astype(np.float32), facing.astype(np.float32), np.zeros(2))


def test_beams_are_counted_for_what_they_say(grids: LocalMap) -> None:
    """Two end at the wall, one before it, one behind it in the next room, one beyond all that is known on this side."""
    scan = beams((-0.05, 0.1), (-0.07, 1.4), (-0.6, -0.2), (1.5, 0.8), (-4.0, 1.0))
    assert agreement(grids, HERE, scan) == Agreement(agree=2, early=1, through=1, unknown=1)


def test_what_went_through_a_wall_counts_even_where_nothing_is_known(grids: LocalMap) -> None:
    """A beam that ends at x = 4, where nothing is known, must have gone through the wall."""
    assert agreement(grids, HERE, beams((4.0, 0.9))).through == 1


def test_the_other_side_of_a_wall_does_not_agree(grids: LocalMap) -> None:
    """A surface that faces away from the robot is not the wall's near side, though it lies where that is."""
    scan = beams((-0.09, 0.1), (-0.09, 0.6), normal=(1.0, 0.0))
    assert agreement(grids, HERE, scan).agree == 0


def test_a_beam_along_a_wall_goes_through_nothing(grids: LocalMap) -> None:
    """A beam that ends at the wall under 4 degrees passes it for metres."""
    here = np.array([-0.3, -4.0, math.pi / 2])
    length = 0.24 / math.sin(math.radians(4))
    point = np.array([[length * math.cos(math.radians(4)), -0.24]], np.float32)
    told = agreement(grids, here, Scan(point, np.zeros((1, 2), np.float32), np.zeros(2)))
    assert told == Agreement(agree=1, early=0, through=0, unknown=0)


def test_fit_and_overlap_are_the_stated_shares() -> None:
    """6 agree, 2 end early (half a weight each), 3 go through: 6 of 10. 9 of 20 say nothing: 11 of 20 do."""
    told = Agreement(agree=6, early=2, through=3, unknown=9)
    assert told.fit == pytest.approx(0.6)
    assert told.overlap == pytest.approx(11 / 20)
    assert Agreement(0, 0, 0, 5).fit == 0
