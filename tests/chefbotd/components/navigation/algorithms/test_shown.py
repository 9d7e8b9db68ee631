"""What people see of navigation: the costs in small parts, and what is not on the map."""

import math

import numpy as np

from chefbotd.components.navigation.algorithms.interface import NavigationParameters, Seen
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.shown import (
    IN_TURN,
    MOST_PATCHES,
    MOST_POINTS,
    ShownCosts,
    cells_of,
    shown_obstacles,
)
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.components.zones.zone_file import NO_ZONES
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, OccupancyGrid

PARAMS = NavigationParameters(outline=Footprint(radius_m=0.2))
ORIGIN = Pose2D(-3.0, 1.0, math.radians(30))


def known(rows: int, columns: int) -> WorldModel:
    """An empty hall with a wall along its lowest row, its map turned by 30 degrees."""
    percent = np.full((rows, columns), FREE, np.int8)
    percent[0] = OCCUPIED
    return WorldModel(PARAMS, OccupancyGrid(0.05, ORIGIN, percent), NO_ZONES)


def test_a_cell_says_what_it_costs() -> None:
    """Free 0, blocked 100, half as much again 10; what is dearer than a byte can say is 99."""
    costs = np.array([[1.0, 1.5, 5.0, 50.0, np.inf]], np.float32)
    assert cells_of(costs).tolist() == [[0, 10, 80, 99, 100]]


def test_all_parts_come_a_few_at_a_time_and_then_only_what_changes() -> None:
    """250 by 330 cells are 20 parts: 8, 8 and 4; they fit together; then four in turn, and what a chair changes."""
    hall, shown = known(250, 330), ShownCosts()
    cells = np.full((250, 330), -1, np.int8)
    counts = []
    for k in range(3):
        patches = shown.changes(hall, 0.5 * k)
        counts.append(len(patches))
        for row, column, part in patches:
            rows, columns = part.shape
            cells[row : row + rows, column : column + columns] = part
    assert (counts[:2], counts[2] >= 4) == ([MOST_PATCHES, MOST_PATCHES], True)
    assert np.array_equal(cells, cells_of(hall.ground.costs))
    assert len(shown.changes(hall, 2.0)) == IN_TURN
    place = ORIGIN.compose(Pose2D(6.0, 5.0))
    hall.add_scan(Seen(2.1, place, np.zeros(2), np.array([[1.02, 0.02], [1.02, 0.03]])))
    changed = shown.changes(hall, 2.2)
    (chair,) = [part for row, column, part in changed if (row, column) == (80, 80)]
    assert chair[100 - 80, 140 - 80] == 100
    assert shown.revision == 1


def test_every_part_comes_again_for_whoever_looks_later() -> None:
    """In turn, four each time: 6 parts within 2 times; another map, or a first look, is another revision."""
    hall, shown = known(150, 170), ShownCosts()
    shown.changes(hall, 0.0)
    again = {patch[:2] for k in range(2) for patch in shown.changes(hall, 1.0 + k)}
    assert again == {(row, column) for row in (0, 80) for column in (0, 80, 160)}
    shown.changes(known(150, 170), 9.0)
    assert shown.revision == 2
    shown.show_all()
    assert len(shown.changes(hall, 10.0)) == 6
    assert shown.revision == 3


def test_obstacles_are_told_in_the_map() -> None:
    """A post 1.02 m ahead of a robot that looks along y, in a map whose grid is turned; the wall of the map is none."""
    hall = known(200, 200)
    pose = Pose2D(0.5, 5.0, math.pi / 2)
    wall = pose.inverse().compose(ORIGIN.compose(Pose2D(4.0, 0.02)))
    points = np.array([[1.02, 0.0], [wall.x_m, wall.y_m]])
    hall.add_scan(Seen(3.0, pose, np.zeros(2), points))
    seen = shown_obstacles(hall, 3.0)
    assert np.allclose(seen.points_m, [[0.5, 6.02]], atol=1e-6)
    assert (seen.omitted, seen.movers.shape) == (0, (0, 4))


def test_who_walks_is_told_with_the_velocity_in_the_map() -> None:
    """0.4 m/s along the map's x, for a second; a second after the last scan nobody knows any more."""
    hall, pose = known(200, 200), Pose2D(-1.0, 4.0, 1.0)
    for k in range(11):
        walker = np.array([[-0.5 + 0.04 * k, 6.0 + 0.05 * each, 0.0] for each in range(4)])
        seen = [pose.inverse().compose(Pose2D(x, y)) for x, y, _ in walker]
        hall.add_scan(Seen(0.1 * k, pose, np.zeros(2), np.array([[each.x_m, each.y_m] for each in seen])))
    (mover,) = shown_obstacles(hall, 1.0).movers
    assert np.allclose(mover[2:], [0.4, 0.0], atol=0.02)
    assert abs(mover[0] - -0.1) < 0.03
    assert len(shown_obstacles(hall, 2.0).movers) == 0


def test_of_too_many_points_a_thousand_are_told() -> None:
    """Spread over all there are, and how many more there are is said."""
    hall, pose = known(200, 200), Pose2D(0.0, 6.0, 0.0)
    grid = np.array([[0.05 * x, 0.05 * y] for x in range(40) for y in range(40)])
    for stamp_s in (0.0, 0.1):  # a far point counts that is there in two turns
        hall.add_scan(Seen(stamp_s, pose, np.zeros(2), grid))
    seen = shown_obstacles(hall, 0.1)
    assert len(seen.points_m) == MOST_POINTS
    assert seen.omitted > 300
