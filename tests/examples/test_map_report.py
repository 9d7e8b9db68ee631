"""A map held against the true walls."""

import math

import numpy as np
import pytest

from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from examples.map_report import wall_errors


def test_walls_are_held_against_the_truth() -> None:
    """Three cells of a wall at x = 1.025, seen by a robot that began at (1, 0, 90 deg), against a wall at y = 1.05."""
    percent = np.full((4, 30), -1, np.int8)
    percent[0:3, 20] = 100
    grid = OccupancyGrid(0.05, Pose2D(0.0, -0.1, 0.0), percent)
    found = wall_errors(grid, Pose2D(1.0, 0.0, math.pi / 2), np.array([[-5.0, 1.05, 5.0, 1.05]]))
    assert found.cells == 3
    assert found.median_m == pytest.approx(0.025)
    with pytest.raises(ValueError, match="no cell"):
        wall_errors(OccupancyGrid(0.05, Pose2D(), np.zeros((3, 3), np.int8)), Pose2D(), np.ones((1, 4)))
