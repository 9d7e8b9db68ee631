"""From a grid to surfaces: their places and sides, against lines drawn by hand."""

import math

import numpy as np
import pytest

from chefbotd.components.localization.algorithms.surface_map import surface_map
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid


def half_plane(
    normal_rad: float, behind_m: float, resolution_m: float = 0.05, at: Pose2D | None = None
) -> OccupancyGrid:
    """A map of 6 by 6 m; a wall ``behind_m`` thick begins at its middle, and what lies against its normal is free.

    Beyond the wall nothing is known.
    """
    count = round(6 / resolution_m)
    middle = (np.arange(count) + 0.5) * resolution_m - 3
    depth = math.cos(normal_rad) * middle[None, :] + math.sin(normal_rad) * middle[:, None]
    percent = np.where(depth < 0, 0, np.where(depth < behind_m, 100, -1)).astype(np.int8)
    return OccupancyGrid(resolution_m, at or Pose2D(-3, -3), percent)


@pytest.mark.parametrize("degrees", [0, 17, 70, 133, 251])
@pytest.mark.parametrize("resolution_m", [0.025, 0.05, 0.075])
def test_a_wall_faces_the_free_side_and_lies_at_its_border(degrees: float, resolution_m: float) -> None:
    """Along an oblique wall all surfaces are within a third of a cell of it, and turned by under 11 degrees."""
    turn = math.radians(degrees)
    found = surface_map(half_plane(turn, 0.3, resolution_m), depth_cells=0).surfaces
    normal = np.array([math.cos(turn), math.sin(turn)])
    inner = (np.abs(found.points) < 2).all(axis=1) & (found.facing != 0).any(axis=1)
    assert inner.sum() > 3 / resolution_m
    assert np.abs(found.points[inner] @ normal).max() < 0.33 * resolution_m
    assert (found.facing[inner] @ -normal).min() > math.cos(math.radians(11))


def test_a_map_that_is_turned_has_its_surfaces_turned() -> None:
    """A wall along x = 0 of the grid's middle, in a grid turned by 0.5 rad about its corner, which lies at (2, -1)."""
    found = surface_map(half_plane(0.0, 0.3, at=Pose2D(2, -1, 0.5)), depth_cells=0).surfaces
    along = np.array([math.cos(0.5), math.sin(0.5)])
    inner = np.abs((found.points - [2, -1]) @ [-along[1], along[0]] - 3) < 2.5
    assert (found.points[inner] - [2, -1]) @ along == pytest.approx(3.0, abs=1e-5)
    assert found.facing[inner] @ along == pytest.approx(-1.0, abs=1e-5)


def test_both_sides_of_a_thin_wall_are_kept_apart() -> None:
    """A wall one cell thick at 33 degrees between two rooms: half of its surfaces face either side, none sideways."""
    turn = math.radians(33)
    middle = (np.arange(120) + 0.5) * 0.05 - 3
    depth = math.cos(turn) * middle[None, :] + math.sin(turn) * middle[:, None]
    percent = np.where(np.abs(depth) < 0.04, 100, 0).astype(np.int8)
    found = surface_map(OccupancyGrid(0.05, Pose2D(-3, -3), percent), depth_cells=0).surfaces
    inner = (np.abs(found.points) < 2).all(axis=1)
    facing = found.facing[inner] @ [math.cos(turn), math.sin(turn)]
    assert (np.abs(facing) > math.cos(math.radians(8))).all()
    assert 0.4 < (facing > 0).mean() < 0.6


def test_a_wall_of_scans_lies_within_its_cells() -> None:
    """With a depth of half a cell, a wall along x = 0 is expected at x = 0.025."""
    found = surface_map(half_plane(0.0, 0.05), depth_cells=0.5).surfaces
    inner = np.abs(found.points[:, 1]) < 2.5
    assert found.points[inner, 0] == pytest.approx(0.025, abs=1e-6)


def test_only_what_faces_free_space_is_a_surface() -> None:
    """Nobody can stand where nothing is known, so the far side of the wall is none."""
    found = surface_map(half_plane(0.0, 0.3), depth_cells=0).surfaces
    assert len(found.points) == 120
    assert found.points[:, 0] == pytest.approx(0.0, abs=0.02)


def test_a_map_without_walls_is_refused() -> None:
    """All free: there is nothing to match against."""
    with pytest.raises(ValueError, match="needs walls beside free space"):
        surface_map(OccupancyGrid(0.05, Pose2D(), np.zeros((9, 9), np.int8)), depth_cells=0)


def test_a_map_that_is_too_large_is_refused_with_its_size() -> None:
    """120 by 120 cells, where 14,000 are allowed."""
    with pytest.raises(ValueError, match="has 14400 cells, at most 14000 are possible"):
        surface_map(half_plane(0.4, 0.3), most_cells=14_000)
