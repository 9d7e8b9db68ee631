"""Many beams at once, each from its own place."""

import math
from pathlib import Path

import numpy as np
import pytest

from chefbotd.components.simulation.rooms import scene_of
from chefbotd.components.simulation.world import NOTHING, RayCaster, World, to_discs_m
from chefbotd.components.simulation.worlds.flat import FLAT

EAST_WALL = np.array([[2.0, -1.0, 2.0, 3.0], [5.0, -9.0, 5.0, 9.0]])


def test_each_beam_is_measured_from_its_own_place() -> None:
    """Toward the wall at x = 2: from x = 0 at 0 deg 2 m; from x = 0.2 at 30 deg 1.8 / cos 30; past its end to x = 5."""
    caster = RayCaster(EAST_WALL, 12.0)
    origins = np.array([[0.0, 0.0], [0.2, 0.1], [0.2, -0.5]])
    hits = caster.cast(origins, np.array([0.0, math.pi / 6, -math.pi / 6]))
    assert hits.range_m == pytest.approx([2.0, 1.8 / math.cos(math.pi / 6), 4.8 / math.cos(math.pi / 6)])
    assert hits.square == pytest.approx([1.0, math.cos(math.pi / 6), math.cos(math.pi / 6)])
    assert hits.edge.tolist() == [0, 0, 1]


def test_a_beam_that_meets_nothing_says_so() -> None:
    """Away from the walls: infinite, and no edge."""
    hits = RayCaster(EAST_WALL, 12.0).cast(np.zeros((2, 2)), np.array([2.9, 3.3]))
    assert np.isinf(hits.range_m).all()
    assert hits.edge.tolist() == [NOTHING, NOTHING]


def test_only_the_walls_of_the_sector_are_looked_at_and_none_is_missed() -> None:
    """On a way through the flat, each tenth of a turn finds what looking at every wall finds."""
    edges, _ = scene_of(Path("flat")).slice(0.2)
    caster, world = RayCaster(edges, 30.0), World(edges)
    chance = np.random.default_rng(3)
    for number in range(300):
        x, y = FLAT.tour[number // 10]
        place = np.array([x, y]) + chance.normal(0, 0.03, 2)
        bearings = chance.uniform(-9, 9) - np.linspace(0, 0.63, 45)
        hits = caster.cast(np.tile(place, (45, 1)), bearings)
        assert hits.range_m == pytest.approx(world.first_hits_m((place[0], place[1]), bearings))


def test_beams_meet_discs_where_they_begin() -> None:
    """A disc of 0.5 m at (3, 0): 2.5 m ahead; past it at 0.2 rad, 0.6 m beside its middle; 0 within; none behind."""
    discs = np.array([[3.0, 0.0, 0.5]])
    origins = np.array([[0.0, 0.0], [0.0, 0.0], [3.1, 0.1], [4.0, 0.0]])
    assert to_discs_m(origins, np.array([0.0, 0.2, 1.0, 0.0]), discs) == pytest.approx(
        [2.5, np.inf, 0.0, np.inf]
    )
    assert np.isinf(to_discs_m(origins, np.zeros(4), np.zeros((0, 3)))).all()
