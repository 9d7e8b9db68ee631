"""Roadmaps small enough to work out by hand."""

import pytest
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace


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
