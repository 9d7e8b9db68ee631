"""Walls: clearance, sliding and beams, in places where the answer is seen by eye."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.components.simulation.world import World
from tests.budget import examples

EAST_WALL = World([(2.0, -5.0, 2.0, 5.0)])
CORNER = World([(2.0, -5.0, 2.0, 2.0), (-5.0, 2.0, 2.0, 2.0)])


def test_clearance_is_to_the_wall_or_to_its_end() -> None:
    """Beside a wall it is the perpendicular; past its end, the distance to the end (3-4-5)."""
    assert EAST_WALL.clearance_m((0.5, 1.0)) == pytest.approx(1.5)
    assert EAST_WALL.clearance_m((5.0, 9.0)) == pytest.approx(5.0)


def test_a_free_move_is_not_touched() -> None:
    """Where nothing is near, the disc lies exactly where it wanted to go."""
    assert EAST_WALL.settle((0.0, 0.0), (0.1, 0.2), 0.5) == (0.1, 0.2)


def test_a_head_on_move_ends_at_the_wall() -> None:
    """A disc of 0.5 m touches the wall at x = 2 with its centre at x = 1.5."""
    assert EAST_WALL.settle((1.49, 0.0), (1.55, 0.0), 0.5) == pytest.approx((1.5, 0.0))


def test_an_oblique_move_slides() -> None:
    """Only the part of the move into the wall is taken away."""
    assert EAST_WALL.settle((1.5, 0.0), (1.6, 0.3), 0.5) == pytest.approx((1.5, 0.3))


def test_a_corner_stops_both_ways() -> None:
    """Pushed into a right corner the disc touches both walls."""
    assert CORNER.settle((1.4, 1.4), (1.55, 1.6), 0.5) == pytest.approx((1.5, 1.5))


def test_a_wedge_too_tight_keeps_the_disc_where_it_was() -> None:
    """Between two walls closer than its diameter no place is found, so the disc stays."""
    wedge = World([(0.0, -1.0, 0.0, 1.0), (0.9, -1.0, 0.9, 1.0)])
    assert wedge.settle((0.45, 3.0), (0.45, 0.0), 0.5) == (0.45, 3.0)


def test_a_move_onto_a_wall_itself_is_refused() -> None:
    """A centre exactly on a wall has no side to be pushed to: the disc stays where it was."""
    assert EAST_WALL.settle((1.0, 0.0), (2.0, 0.0), 0.5) == (1.0, 0.0)


@settings(max_examples=examples(40))
@given(moves=st.lists(st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)), max_size=150))
def test_no_walk_passes_a_wall(moves: list[tuple[float, float]]) -> None:
    """However a disc is moved about, it stays in its box and off the walls."""
    box = World([(0, 0, 1, 0), (1, 0, 1, 1), (1, 1, 0, 1), (0, 1, 0, 0)])
    place = (0.5, 0.5)
    for dx, dy in moves:
        place = box.settle(place, (place[0] + dx * 2, place[1] + dy * 2), 0.3)
        assert 0 < place[0] < 1
        assert 0 < place[1] < 1
        assert box.clearance_m(place) >= 0.3 - 1e-6


def test_beams_meet_the_nearest_wall() -> None:
    """From the origin the wall at x = 2 is 2 m ahead, 2 * sqrt(2) m at 45 degrees, and nowhere behind."""
    hits = EAST_WALL.first_hits_m((0.0, 0.0), np.array([0.0, math.pi / 4, math.pi]))
    assert hits == pytest.approx([2.0, 2 * math.sqrt(2), math.inf])


def test_a_beam_along_a_wall_does_not_hit_it() -> None:
    """A parallel beam meets nothing, without a warning or an error."""
    assert EAST_WALL.first_hits_m((1.0, 0.0), np.array([math.pi / 2]))[0] > 1e9
    level = World([(1.0, 0.0, 2.0, 0.0)])
    assert level.first_hits_m((0.0, 1.0), np.array([0.0])).tolist() == [math.inf]


def test_a_beam_past_the_end_of_a_wall_misses() -> None:
    """The wall ends at y = 5: a beam at atan(3) passes above it."""
    assert EAST_WALL.first_hits_m((0.0, 0.0), np.array([math.atan(3.0)])).tolist() == [math.inf]


@pytest.mark.parametrize("walls", [[], [(0.0, 0.0, 0.0, 0.0)], [(0.0, 0.0, 1.0)]])
def test_walls_that_are_none_are_refused(walls: list[tuple[float, float, float, float]]) -> None:
    """No walls, a wall without length and a row of the wrong shape raise ``ValueError``."""
    with pytest.raises(ValueError, match="wall"):
        World(walls)
