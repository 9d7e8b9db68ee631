"""Outlines of masks have exactly the cells in them that are marked, cell by cell."""

import numpy as np
import pytest

from chefbotd.components.maps.outlines import why_no_area
from chefbotd.components.navigation.algorithms.grid import GridFrame
from chefbotd.components.navigation.algorithms.zones import keep_out_cells
from chefbotd.components.zones.algorithms.trace import Flags, Floats, trace_areas
from chefbotd.components.zones.zone_file import Zone, Zones
from chefbotd.core.geometry import Pose2D


def cells_in(outlines: list[Floats], mask: Flags) -> Flags:
    """The cells that navigation keeps out of with these outlines, in a map of cells of 1 m."""
    frame = GridFrame(1.0, Pose2D(), *mask.shape)
    zones = Zones(keep_out=tuple(Zone(corners_m=tuple(map(tuple, outline))) for outline in outlines))
    return keep_out_cells(zones, frame)


def drawn(text: str) -> Flags:
    """A mask from a picture, the lowest row last."""
    return np.array([[cell == "#" for cell in line] for line in text.split()][::-1])


@pytest.mark.parametrize(
    ("text", "areas"),
    [
        ("....  .##.  .##.  ....", 1),
        ("#..#  ....  ....  #..#", 4),
        ("#...  .#..  ..#.  ...#", 4),
        ("####  #..#  #..#  ####", 2),
        ("#####  #.#.#  #####  #.#.#  #####", 3),
        ("##.##  ##.##  .....  ##.##", 4),
        ("#", 1),
    ],
)
def test_squares_rings_and_cells_that_touch_at_a_corner(text: str, areas: int) -> None:
    """Rings are cut in pieces without holes; cells that touch at a corner alone are areas of their own."""
    mask = drawn(text)
    outlines = list(trace_areas(mask))
    assert np.array_equal(cells_in(outlines, mask), mask)
    assert len(outlines) == areas


def test_a_rectangle_has_four_corners_and_a_slope_few() -> None:
    """A straight slope of 60 steps is a straight line."""
    rectangle = np.zeros((20, 30), np.bool_)
    rectangle[3:9, 5:25] = True
    (outline,) = trace_areas(rectangle)
    assert sorted(map(tuple, outline.tolist())) == [(5, 3), (5, 9), (25, 3), (25, 9)]
    slope = np.tri(60, dtype=np.bool_)
    (outline,) = trace_areas(slope)
    assert len(outline) <= 8
    assert np.array_equal(cells_in([outline], slope), slope)


@pytest.mark.parametrize("seed", range(40))
def test_any_mask_is_traced_cell_by_cell(seed: int) -> None:
    """Noise, blobs and circles with holes; every outline is an area that zones accept, with few corners."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:60, :80]
    mask = np.zeros((60, 80), np.bool_)
    for _ in range(8):
        cx, cy, radius = rng.uniform(0, 80), rng.uniform(0, 60), rng.uniform(2, 15)
        mask ^= np.hypot(x - cx, y - cy) < radius
    if seed % 4 == 0:
        mask ^= rng.random(mask.shape) < 0.02
    outlines = list(trace_areas(mask, 60))
    assert np.array_equal(cells_in(outlines, mask), mask)
    assert max(map(len, outlines), default=0) <= 60
    assert not [why for outline in outlines if (why := why_no_area(outline.tolist()))]
