"""Occupancy of a handful of beams, counted by hand."""

import numpy as np
import pytest

from chefbotd.components.mapping.algorithms.occupancy import occupancy
from chefbotd.components.mapping.algorithms.state import Nodes, Scan
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.record import replace


def nodes(*scans: list[tuple[float, float]], pose: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Nodes:
    """Scans with these points, all taken at one pose."""
    count = len(scans)
    return Nodes(
        np.arange(count),
        np.zeros(count),
        np.tile(pose, (count, 1)),
        np.tile(pose, (count, 1)),
        np.zeros(count),
        np.zeros(count, np.int64),
        tuple(
            Scan(np.array(points, np.float32), np.zeros((len(points), 2), np.float32), np.zeros(2))
            for points in scans
        ),
    )


def percent(grid: OccupancyGrid, x: float, y: float) -> int:
    """What the map says of a place."""
    column = int((x - grid.map_from_grid.x_m) / grid.resolution_m)
    row = int((y - grid.map_from_grid.y_m) / grid.resolution_m)
    return int(grid.percent[row, column])


def test_a_beam_clears_what_it_passes_and_marks_its_end() -> None:
    """Two scans of a post at 1.02 m: it is occupied, the way to it free but for the last 15 cm, the rest unknown."""
    grid = occupancy(nodes([(1.02, 0.02)], [(1.02, 0.02)]))
    assert percent(grid, 1.02, 0.02) == 100
    assert [percent(grid, x, 0.02) for x in (0.02, 0.42, 0.83)] == [0, 0, 0]
    assert percent(grid, 0.97, 0.02) == -1
    assert percent(grid, 0.5, 0.3) == -1
    assert percent(grid, 1.3, 0.02) == -1


def test_each_beam_clears_the_way_from_its_own_lidar() -> None:
    """Lidars at the middle and 1 m to its left, each sees a post straight ahead: nothing slanting is cleared."""
    posts = np.array([(1.02, 0.02), (1.02, 1.02)], np.float32)
    scan = Scan(posts, np.zeros((2, 2), np.float32), np.array([[0.0, 0.0], [0.0, 1.0]]))
    grid = occupancy(replace(nodes([(0.0, 0.0)], [(0.0, 0.0)]), scans=(scan, scan)))
    assert [percent(grid, 1.02, y) for y in (0.02, 1.02)] == [100, 100]
    assert [percent(grid, 0.52, y) for y in (0.02, 1.02)] == [0, 0]
    assert percent(grid, 0.52, 0.52) == -1


def test_poses_turn_the_scans() -> None:
    """From (2, 1), looking left, a post 1 m ahead is at (2, 2)."""
    grid = occupancy(nodes([(1.02, 0.02)], [(1.02, 0.02)], pose=(2.0, 1.0, np.pi / 2)))
    assert percent(grid, 1.98, 2.02) == 100
    assert percent(grid, 1.98, 1.5) == 0


def test_one_beam_is_not_enough() -> None:
    """What a single beam says may be a spark of dust."""
    grid = occupancy(nodes([(1.02, 0.02)]))
    assert percent(grid, 1.02, 0.02) == -1


def test_somebody_who_walked_through_is_gone() -> None:
    """One beam in thirteen ended at a leg, twelve went on: 4 of 4 + 12 is 25 percent, so not occupied."""
    wall = [(2.02, 0.02)]
    grid = occupancy(nodes([(1.02, 0.02)], *[wall] * 12))
    assert percent(grid, 1.02, 0.02) == 25
    assert percent(grid, 2.02, 0.02) == 100


@pytest.mark.parametrize(("ends", "expected"), [(1, -1), (3, 100)])
def test_what_strays_beyond_a_wall_is_that_walls_noise(ends: int, expected: int) -> None:
    """Ten beams end at the wall. One in the cell behind is noise; three are too many for that."""
    grid = occupancy(nodes(*[[(1.02, 0.02)]] * 10, *[[(1.07, 0.02)]] * ends))
    assert percent(grid, 1.02, 0.02) == 100
    assert percent(grid, 1.07, 0.02) == expected
