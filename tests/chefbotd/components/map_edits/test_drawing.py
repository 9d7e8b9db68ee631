"""Edits drawn onto the cells of a map, against a mask that is made point by point."""

import math
import random
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from chefbotd.components.map_edits.algorithms.drawing import OPEN, OUTSIDE, WALL, DrawnCells, draw_edits
from chefbotd.components.map_edits.edit_file import Crop, DrawWall, Erase, MapEdit
from chefbotd.components.maps.storage.manifest import Extent

EXTENT = Extent(resolution_m=0.1, columns=30, rows=20, x_m=-1.0, y_m=0.5, heading_rad=0.0)
TURNED = Extent(resolution_m=0.1, columns=30, rows=20, x_m=2.0, y_m=-1.0, heading_rad=0.7)
CELLS = bytes(random.Random(1).choices([0, 100, 255, 30], k=600))
SQUARE = ((0.0, 1.0), (1.0, 1.0), (1.0, 1.5), (0.0, 1.5))
"""Columns 10 to 19, rows 5 to 9 of ``EXTENT``."""


def array(cells: bytes | bytearray) -> NDArray[np.int8]:
    """Rows and columns of percentages."""
    return np.frombuffer(bytes(cells), np.int8).reshape(20, 30)


def draw(*edits: MapEdit, extent: Extent = EXTENT) -> DrawnCells:
    """These edits on the cells."""
    return draw_edits(CELLS, extent, edits)


@pytest.mark.parametrize(("to", "value"), [("free", 0), ("unknown", -1)])
def test_what_is_erased_is_free_or_unknown_and_nothing_else_changes(to: str, value: int) -> None:
    """The square of ten by five cells, and no other cell."""
    drawn = draw(Erase.model_validate({"to": to, "points_m": SQUARE}))
    expected = array(CELLS).copy()
    expected[5:10, 10:20] = value
    assert (array(drawn.erased) == expected).all()
    assert drawn.shown() == bytes(drawn.erased)
    assert not any(drawn.closed)


def test_without_edits_a_map_is_what_it_was() -> None:
    """To the byte, as it is shown and as it is matched."""
    drawn = draw()
    assert bytes(drawn.erased) == drawn.shown() == CELLS


def test_a_wall_is_shown_and_closes_cells_but_is_not_matched() -> None:
    """Three cells wide along the middle of row 10; the percentages by which localization finds its way stay."""
    drawn = draw(DrawWall(points_m=((0.0, 1.55), (1.0, 1.55)), width_m=0.3))
    assert bytes(drawn.erased) == CELLS
    marks = array(drawn.closed)
    assert (marks[9:12, 10:20] == WALL).all()
    assert (marks[:8] == OPEN).all()
    assert (marks[13:] == OPEN).all()
    assert (array(drawn.shown())[marks == WALL] == 100).all()


def test_a_wall_is_erased_by_what_is_drawn_later_and_not_by_what_was_drawn_before() -> None:
    """The order in which they were drawn counts."""
    wall, erase = DrawWall(points_m=((-0.5, 1.25), (1.5, 1.25))), Erase(to="free", points_m=SQUARE)
    assert not array(draw(wall, erase).closed)[7, 10:20].any()
    assert (array(draw(erase, wall).closed)[7, 6:24] == WALL).all()


def test_what_is_outside_of_a_crop_is_unknown_and_closed_whatever_is_drawn_there() -> None:
    """Erased there or not, and cropped twice it is what both have left."""
    wide = Crop(points_m=((-1.0, 0.5), (1.0, 0.5), (1.0, 2.5), (-1.0, 2.5)))
    drawn = draw(
        wide,
        DrawWall(points_m=((1.5, 0.5), (1.5, 2.5))),
        Crop(points_m=((0.0, 0.5), (2.0, 0.5), (2.0, 2.5), (0.0, 2.5))),
    )
    marks, shown = array(drawn.closed), array(drawn.shown())
    assert (marks[:, 10:20] == OPEN).all()
    assert (marks[:, :10] == OUTSIDE).all()
    assert (marks[:, 20:] == OUTSIDE).all()
    assert (shown[:, 10:20] == array(CELLS)[:, 10:20]).all()
    assert (shown[marks == OUTSIDE] == -1).all()
    assert bytes(drawn.erased) == CELLS


def middles_in_map(extent: Extent) -> NDArray[np.float64]:
    """The middle of each cell (rows, columns, 2)."""
    x, y = np.meshgrid((np.arange(30) + 0.5) * 0.1, (np.arange(20) + 0.5) * 0.1)
    cos, sin = math.cos(extent.heading_rad), math.sin(extent.heading_rad)
    return np.stack([extent.x_m + cos * x - sin * y, extent.y_m + sin * x + cos * y], axis=-1)


def is_inside(point: NDArray[np.float64], corners: tuple[tuple[float, float], ...]) -> bool:
    """The even-odd rule with a ray to the right, for one point."""
    x, y = point
    crossed = [
        x < ax + (y - ay) * (bx - ax) / (by - ay)
        for (ax, ay), (bx, by) in zip(corners, (*corners[1:], corners[0]), strict=True)
        if (ay > y) != (by > y)
    ]
    return sum(crossed) % 2 == 1


def apart_m(point: NDArray[np.float64], points: tuple[tuple[float, float], ...]) -> float:
    """From a point to the nearest place of a line."""
    nearest = math.inf
    for start, end in pairwise(np.array(points)):
        along = end - start
        share = np.clip((point - start) @ along / max(along @ along, 1e-12), 0, 1)
        nearest = min(nearest, float(np.hypot(*(point - start - share * along))))
    return nearest


@pytest.mark.parametrize("extent", [EXTENT, TURNED], ids=["straight", "turned"])
@pytest.mark.parametrize("seed", range(20))
def test_any_outline_takes_the_cells_whose_middle_is_in_it(seed: int, extent: Extent) -> None:
    """Three to eight corners by chance, also outside of the map and crossing; and a wall along them."""
    rng = random.Random(seed)
    middles = middles_in_map(extent)
    low, high = middles.min(axis=(0, 1)) - 0.5, middles.max(axis=(0, 1)) + 0.5
    points = tuple(
        (rng.uniform(low[0], high[0]), rng.uniform(low[1], high[1])) for _ in range(rng.randint(3, 8))
    )
    width_m = rng.choice([0.05, 0.3, 0.8])
    area = array(draw(Crop(points_m=points), extent=extent).closed) == OPEN
    wall = array(draw(DrawWall(points_m=points, width_m=width_m), extent=extent).closed) == WALL
    reach_m = max(width_m / 2, 0.1 * math.sqrt(0.5))
    for row in range(20):
        for column in range(30):
            middle = middles[row, column]
            assert area[row, column] == is_inside(middle, points)
            away_m = apart_m(middle, points)
            if abs(away_m - reach_m) > 1e-9:
                assert wall[row, column] == (away_m < reach_m)
