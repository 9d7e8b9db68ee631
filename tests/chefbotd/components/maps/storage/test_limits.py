"""What a map costs is known from its extent: in metres as well as in cells."""

import math
from pathlib import Path

import numpy as np
import pytest

from chefbotd.components.maps.storage.contents import read_map_server
from chefbotd.components.maps.storage.limits import needed_memory_mb, why_doubtful, why_too_large
from chefbotd.components.maps.storage.manifest import Extent
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    OccupancyGrid,
    crop_grid,
)

MOST_MB = 800.0  # of [worker] max_memory_mb


def extent(columns: int, rows: int, resolution_m: float) -> Extent:
    """A map of this size at the origin."""
    return Extent(resolution_m=resolution_m, columns=columns, rows=rows, x_m=0.0, y_m=0.0, heading_rad=0.0)


@pytest.mark.parametrize(
    ("size", "measured_mb"),
    [
        ((600, 400, 0.05), 136),
        ((1500, 1000, 0.05), 247),
        ((2000, 2000, 0.05), 459),
        ((2940, 2000, 0.05), 622),
        ((600, 600, 0.5), 1122),
        ((1000, 1000, 0.1), 294),
        ((1000, 1000, 0.025), 183),
    ],
)
def test_the_estimate_is_above_what_was_measured(size: tuple[int, int, float], measured_mb: float) -> None:
    """By a quarter to a third, with a search of the whole map and without a plan."""
    assert 1.2 * measured_mb < needed_memory_mb(extent(*size)) < 1.5 * measured_mb


def test_metres_count_as_well_as_cells() -> None:
    """80 bytes a cell and 14,000 a square metre, beside 150 MB: 1 million cells of 5 and of 50 cm."""
    assert needed_memory_mb(extent(1000, 1000, 0.05)) == pytest.approx(150 + 80 + 35)
    assert needed_memory_mb(extent(1000, 1000, 0.5)) == pytest.approx(150 + 80 + 3500)


@pytest.mark.parametrize("size", [(2940, 2000, 0.05), (600, 600, 0.5), (400, 300, 5.0), (4000, 4000, 0.05)])
def test_a_map_that_the_worker_cannot_hold_is_refused_with_figures_and_a_way(
    size: tuple[int, int, float],
) -> None:
    """Its metres, its cells, what it needs and what is allowed; crop, coarser, or more memory."""
    reason = why_too_large(extent(*size), MOST_MB)
    needed_mb = needed_memory_mb(extent(*size))
    for part in (
        f"{size[0]} by {size[1]} cells",
        f"about {needed_mb:.0f} MB",
        "the worker may take 800",
        "crop",
        "larger cells",
    ):
        assert part in reason


@pytest.mark.parametrize(
    "size", [(576, 512, 0.05), (1500, 1000, 0.05), (1000, 1000, 0.1), (2000, 2000, 0.05)]
)
def test_usual_maps_are_not_refused(size: tuple[int, int, float]) -> None:
    """A flat, a floor of 75 by 50 m, a hall of 100 by 100 m in cells of 10 and of 5 cm."""
    assert not why_too_large(extent(*size), MOST_MB)
    assert not why_doubtful(extent(*size))


@pytest.mark.parametrize("size", [(400, 300, 5.0), (600, 600, 0.5), (180, 120, 0.5), (5000, 100, 0.25)])
def test_a_resolution_that_can_hardly_be_meant_is_doubted(size: tuple[int, int, float]) -> None:
    """More than a quarter of a metre, or more than a kilometre of floor."""
    assert f"a resolution of {size[2]:g} m makes it" in why_doubtful(extent(*size))


def test_what_is_unknown_around_the_known_is_cropped_with_a_margin() -> None:
    """Cells of 0.5 m, a margin of 1 m: 2 cells on each side, as far as there are any; the known keeps its place."""
    cells = np.full((20, 30), UNKNOWN, np.int8)
    cells[5:8, 1:11] = FREE
    cells[6, 10] = OCCUPIED
    grid = OccupancyGrid(0.5, Pose2D(-3.0, 2.0, math.pi / 2), cells)
    small = crop_grid(grid, 1.0)
    assert small.percent.shape == (3 + 2 + 2, 10 + 1 + 2)
    assert (small.percent == cells[3:10, 0:13]).all()
    # 3 rows lower are 1.5 m along the grid's y, which a quarter turn makes -x in the map.
    assert small.map_from_grid == Pose2D(pytest.approx(-4.5), pytest.approx(2.0), pytest.approx(math.pi / 2))


@pytest.mark.parametrize("value", [FREE, UNKNOWN])
def test_a_map_that_is_known_or_unknown_everywhere_stays_as_it_is(value: int) -> None:
    """There is nothing to crop."""
    grid = OccupancyGrid(0.05, Pose2D(), np.full((5, 6), value, np.int8))
    assert crop_grid(grid, 1.0) is grid


@pytest.mark.parametrize(("free_thresh", "is_said"), [(0.25, True), (0.196, False)])
def test_unknown_cells_that_are_read_as_free_are_said(
    tmp_path: Path, free_thresh: float, is_said: bool
) -> None:
    """Nav2's free_thresh of 0.25 takes the grey 205, 0.196 occupied, for free: nothing is unknown then."""
    (tmp_path / "a.pgm").write_bytes(b"P5\n3 1\n255\n" + bytes([0, 205, 254]))
    text = f"image: a.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nfree_thresh: {free_thresh}\n"
    (tmp_path / "a.yaml").write_text(text, encoding="utf-8")
    notes = read_map_server(tmp_path / "a.yaml").notes
    assert any("no cell is unknown" in note for note in notes) is is_said
