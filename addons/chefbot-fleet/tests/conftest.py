"""Roadmaps small enough to work out by hand, and a manager with one robot on one of them."""

from pathlib import Path

import pytest
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace
from fleet_world import World, small_roadmap


@pytest.fixture
def corridor() -> Roadmap:
    """Five nodes a metre apart in a line, and beside the middle one a passing place a metre off.

    ::

              5
              |
        0--1--2--3--4
    """
    points = ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (4.0, 0.0), (2.0, 1.0))
    return Roadmap(points, ((0, 1), (1, 2), (2, 3), (3, 4), (2, 5)), 0.6)


@pytest.fixture
def pace() -> Pace:
    """Half a metre a second and no time for the nodes: two seconds an edge."""
    return Pace(0.5, 0.0)


@pytest.fixture
def world(tmp_path: Path) -> World:
    """One robot, at home at 0, and one order: from the counter at 6, beside 1, to the table at 7, beside 3."""
    world = World(small_roadmap(), tmp_path / "fleet.db", robots=1)
    world.step()
    world.fleet.add_order("a", "counter", "table", 0.0)
    return world
