"""A roadmap, and which of its parts exclude each other."""

import math

import numpy as np
import pytest
from chefbot_fleet.roadmap import Roadmap, segment_distances_m


@pytest.mark.parametrize(
    ("first", "second", "distance_m"),
    [
        ((0, 0, 2, 0), (1, -1, 1, 1), 0.0),  # crossing
        ((0, 0, 2, 0), (0, 1, 2, 1), 1.0),  # side by side
        ((0, 0, 1, 0), (2, 1, 3, 1), math.sqrt(2)),  # end to end
        ((0, 0, 2, 0), (1, 0.5, 1, 0.5), 0.5),  # a point beside the middle
        ((0, 0, 0, 0), (3, 4, 3, 4), 5.0),  # two points
    ],
)
def test_the_distance_between_segments(
    first: tuple[float, ...], second: tuple[float, ...], distance_m: float
) -> None:
    """In either order."""
    a, b = np.array([first], float), np.array([second], float)
    assert segment_distances_m(a, b)[0, 0] == pytest.approx(distance_m)
    assert segment_distances_m(b, a)[0, 0] == pytest.approx(distance_m)


def test_robots_exclude_each_other_by_geometry(corridor: Roadmap) -> None:
    """0.6 m between robots, nodes a metre apart: an edge excludes its neighbours, a passing place only its own."""
    assert corridor.nodes_at_node[2] == {2}
    assert corridor.nodes_at_edge[1] == {1, 2}
    assert corridor.edges_at_edge[0] == {0, 1}
    assert corridor.edges_at_edge[4] == {1, 2, 4}
    assert corridor.edges_at_node[5] == {4}


def test_edges_that_cross_without_a_node_exclude_each_other() -> None:
    """Nothing but their place says so."""
    crossing = Roadmap(((0, 0), (2, 0), (1, -1), (1, 1)), ((0, 1), (2, 3)), 0.6)
    assert crossing.edges_at_edge[0] == {0, 1}


def test_only_the_ends_and_the_passing_place_cut_nobody_off(corridor: Roadmap) -> None:
    """A robot in the middle of a corridor divides it."""
    assert corridor.passing_places == (0, 4, 5)
    assert corridor.remains_connected([0, 4, 5])
    assert not corridor.remains_connected([1])


def test_homes_are_places_where_all_robots_can_stand_at_once(corridor: Roadmap) -> None:
    """Named nodes are for work and are nobody's home; too many robots are refused."""
    assert set(corridor.homes(3)) == {0, 4, 5}
    with pytest.raises(ValueError, match="4 robots: the map has 3 places"):
        corridor.homes(4)
    named = Roadmap(corridor.points_m, corridor.edges, 0.6, {"counter": 4})
    assert set(named.homes(2)) == {0, 5}


def test_an_edge_can_be_added_and_removed(corridor: Roadmap) -> None:
    """Distances follow; what is not there cannot be removed."""
    assert corridor.distance_m[0, 4] == 4.0
    cut = corridor.without_edge(2, 1)
    assert math.isinf(cut.distance_m[0, 4])
    assert cut.with_edge(1, 2).distance_m[0, 4] == 4.0
    with pytest.raises(ValueError, match="no edge between 0 and 4"):
        corridor.without_edge(0, 4)


def test_a_passing_place_can_be_added(corridor: Roadmap) -> None:
    """With a name it is a place to work."""
    grown = corridor.with_node((1.0, 1.0), 1, "table")
    assert grown.names == {"table": 6}
    assert grown.distance_m[0, 6] == 2.0


@pytest.mark.parametrize("edges", [((0, 2),), ((1, 1),), ((0, 1), (1, 0))])
def test_edges_that_are_none_are_refused(edges: tuple[tuple[int, int], ...]) -> None:
    """A missing node, a loop, an edge twice."""
    with pytest.raises(ValueError, match="edge"):
        Roadmap(((0, 0), (1, 0)), edges, 0.6)
