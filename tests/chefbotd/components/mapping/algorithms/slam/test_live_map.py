"""The grid of a map that grows: the same as one made at once, and its changes put together are the grid."""

import numpy as np
import pytest

from chefbotd.components.mapping.algorithms.live_map import (
    LiveMap,
    changes,
    grid_of,
    nothing,
    update_live_map,
)
from chefbotd.components.mapping.algorithms.occupancy import occupancy
from chefbotd.components.mapping.algorithms.state import NO_NODES, Nodes
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.record import replace
from tests.chefbotd.components.mapping.algorithms.slam.drives import drive
from tests.chefbotd.components.mapping.algorithms.slam.flat import (
    TOUR,
    Lidar,
    furnished_flat,
    odometry,
    poses_along,
)


@pytest.fixture(scope="module")
def nodes() -> Nodes:
    """Kept scans of the beginning of a tour."""
    truth = poses_along(TOUR[:5])
    lidar = Lidar(furnished_flat(), 3)
    return drive(odometry(truth, 3), lambda k: lidar.points(truth[k]), finish=False).state.nodes


def first(nodes: Nodes, count: int) -> Nodes:
    """The nodes that there were earlier."""
    fields = {name: getattr(nodes, name)[:count] for name in Nodes.__struct_fields__}
    return Nodes(**fields)


def known(grid: OccupancyGrid) -> dict[tuple[int, int], int]:
    """The known cells by their place in ``map``, whatever the grid's extent."""
    row, column = round(grid.map_from_grid.y_m / 0.05), round(grid.map_from_grid.x_m / 0.05)
    rows, columns = np.nonzero(grid.percent >= 0)
    cells = zip(rows.tolist(), columns.tolist(), grid.percent[rows, columns].tolist(), strict=True)
    return {(row + r, column + c): percent for r, c, percent in cells}


def grown(nodes: Nodes) -> LiveMap:
    """The live map, scan by scan."""
    live = nothing(0.05)
    for count in range(1, len(nodes) + 1):
        live = update_live_map(live, first(nodes, count))
    return live


def grid(live: LiveMap) -> OccupancyGrid:
    """Its grid, which is there."""
    found = grid_of(live)
    assert found is not None
    return found


def test_scan_by_scan_it_is_the_map_that_is_made_at_once(nodes: Nodes) -> None:
    """Every known cell has the percentage that the finished map would give it, however the grid had to grow."""
    assert len(nodes) > 30
    assert known(grid(grown(nodes))) == known(occupancy(nodes))


def test_scans_that_the_graph_has_moved_are_drawn_anew(nodes: Nodes) -> None:
    """After a loop is closed nothing of the old places remains."""
    live = grown(first(nodes, 20))
    moved = replace(nodes, map=nodes.map + np.array([0.4, -0.3, 0.0]))
    assert known(grid(update_live_map(live, moved))) == known(occupancy(moved))


def test_forgotten_scans_are_not_in_it(nodes: Nodes) -> None:
    """A scan that is kept no longer is taken out."""
    live, fewer = grown(nodes), first(nodes, 25)
    assert known(grid(update_live_map(live, fewer))) == known(occupancy(fewer))


def test_nothing_gives_no_grid() -> None:
    """Before the first scan there is none."""
    assert grid_of(update_live_map(nothing(0.05), NO_NODES)) is None


def test_changes_put_together_are_the_grid(nodes: Nodes) -> None:
    """Whoever applies each rectangle, and begins anew at a whole one, has the same cells as the one who made it."""
    live, before, copy = nothing(0.05), None, np.zeros((0, 0), np.int8)
    wholes = 0
    for count in range(1, len(nodes) + 1, 3):
        live = update_live_map(live, first(nodes, count))
        after = grid(live)
        patch = changes(before, after)
        if patch is not None:
            row, column, percent = patch
            rows, columns = percent.shape
            if percent.shape == after.percent.shape:
                copy, wholes = percent.copy(), wholes + 1
            copy[row : row + rows, column : column + columns] = percent
        assert np.array_equal(copy, after.percent)
        before = after
    assert 1 <= wholes < 6, "a new extent is rare"


def test_the_rectangle_is_the_smallest() -> None:
    """Two changed cells span it; no change is no patch; another resolution is a new grid."""
    cells = np.full((7, 9), -1, np.int8)
    before = OccupancyGrid(0.05, Pose2D(-1.0, 2.0), cells.copy())
    cells[2, 3], cells[5, 4] = 100, 0
    after = OccupancyGrid(0.05, Pose2D(-1.0, 2.0), cells)
    patch = changes(before, after)
    assert patch is not None
    row, column, percent = patch
    assert (row, column, percent.shape) == (2, 3, (4, 2))
    assert changes(after, after) is None
    other = changes(replace(before, resolution_m=0.1), after)
    assert other is not None
    assert other[2].shape == (7, 9)
