"""Lanes and passing places that are found in a map."""

import numpy as np
import pytest
from chefbot_fleet.lanes import LaneParameters, find_lanes, free_space, thinned
from chefbot_fleet.roadmap import Roadmap, segment_distances_m
from scipy.ndimage import label

from chefbotd.components.simulation.rooms import BUILDINGS
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, OccupancyGrid

PARAMETERS = LaneParameters()
OFFICE = BUILDINGS["office"]


@pytest.fixture(scope="module")
def office() -> Roadmap:
    """The simulator's office."""
    return find_lanes(OFFICE.grid(), PARAMETERS, {"desk": (2.9, 1.6)})


def corridor_grid(width_m: float, turned_rad: float = 0.0) -> OccupancyGrid:
    """A straight corridor of 6 m along the grid's x axis, its lower left inner corner at (0.1, 0.1)."""
    rows = round(width_m / 0.05)
    cells = np.full((rows + 4, 124), OCCUPIED, np.int8)
    cells[2:-2, 2:-2] = FREE
    return OccupancyGrid(0.05, Pose2D(0.0, 0.0, turned_rad), cells)


def test_thinning_leaves_one_line_of_one_cell_in_one_piece() -> None:
    """A bar of 5 by 20 cells becomes a line in its middle."""
    bar = np.zeros((9, 24), np.bool_)
    bar[2:7, 2:22] = True
    line = thinned(bar)
    assert line[4, 6:18].all()
    assert line[:, 6:18].sum() == 12
    assert label(line, np.ones((3, 3)))[1] == 1


def test_thinning_keeps_a_way_around_a_pillar() -> None:
    """A ring stays a ring: its hole does not open."""
    ring = np.zeros((15, 15), np.bool_)
    ring[2:13, 2:13] = True
    ring[6:9, 6:9] = False
    line = thinned(ring)
    assert label(line, np.ones((3, 3)))[1] == 1
    assert label(~line)[1] == 2


def test_a_lane_runs_in_the_middle_of_a_narrow_corridor() -> None:
    """In 0.8 m two robots cannot pass: there is a lane at half its width, and no passing place."""
    roadmap = find_lanes(corridor_grid(0.8), PARAMETERS)
    points = np.array(roadmap.points_m)
    assert points[:, 1] == pytest.approx(np.full(len(points), 0.5), abs=0.06)
    assert points[:, 0].max() - points[:, 0].min() > 5.0
    assert len(roadmap.edges) == len(points) - 1


def test_a_wide_corridor_has_passing_places_beside_its_lane() -> None:
    """In 2 m: at least 0.6 m from the lane, where a robot excludes nobody on it."""
    roadmap = find_lanes(corridor_grid(2.0), PARAMETERS)
    lane = {node for node in range(len(roadmap.points_m)) if abs(roadmap.points_m[node][1] - 1.1) < 0.06}
    lane_edges = {k for k, (a, b) in enumerate(roadmap.edges) if a in lane and b in lane}
    aside = set(range(len(roadmap.points_m))) - lane
    assert aside & set(roadmap.passing_places)
    assert all(
        not roadmap.edges_at_node[node] & lane_edges
        for node in aside
        if abs(roadmap.points_m[node][1] - 1.1) > 0.6
    )


def test_a_turned_map_has_the_same_lanes_turned() -> None:
    """By 90 degrees: (x, y) becomes (-y, x)."""
    plain, turned = (
        find_lanes(corridor_grid(0.8), PARAMETERS),
        find_lanes(corridor_grid(0.8, np.pi / 2), PARAMETERS),
    )
    expected = [(-y, x) for x, y in plain.points_m]
    assert np.array(turned.points_m) == pytest.approx(np.array(expected), abs=1e-9)


def test_every_room_of_the_office_is_on_the_roadmap_and_can_be_reached(office: Roadmap) -> None:
    """A node within 1 m of each, and a route between any two nodes."""
    points = np.array(office.points_m)
    for name, (x_m, y_m) in OFFICE.rooms.items():
        assert np.hypot(*(points - (x_m, y_m)).T).min() < 1.0, name
    assert np.isfinite(office.distance_m).all()


def test_every_edge_keeps_its_clearance_to_everything(office: Roadmap) -> None:
    """Measured against the occupied cells themselves: 0.28 m, less half a cell of each grid."""
    grid = OFFICE.grid()
    cells = np.argwhere(grid.percent == OCCUPIED)
    middles = (cells[:, ::-1] + 0.5) * grid.resolution_m + [grid.map_from_grid.x_m, grid.map_from_grid.y_m]
    for a, b in office.edges[:: max(1, len(office.edges) // 60)]:
        edge = np.array([[*office.points_m[a], *office.points_m[b]]])
        near = middles[(np.abs(middles - edge[0, :2]) < 3).all(axis=1)]
        assert segment_distances_m(edge, np.hstack([near, near])).min() > 0.28 - 0.05


def test_ten_robots_have_homes_in_the_office(office: Roadmap) -> None:
    """At which they cut nobody off, even all at once."""
    homes = office.homes(10)
    assert len(set(homes)) == 10
    assert office.remains_connected(list(homes))
    assert office.names["desk"] not in homes


def test_places_that_cannot_be_reached_are_named() -> None:
    """In a wall; and a map without free space."""
    with pytest.raises(ValueError, match="kitchen: the robot has not its clearance there"):
        find_lanes(corridor_grid(0.8), PARAMETERS, {"kitchen": (0.0, 0.0)})
    with pytest.raises(ValueError, match="no free space"):
        free_space(corridor_grid(0.4), PARAMETERS)
