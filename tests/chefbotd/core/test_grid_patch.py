"""A grid put together from its patches: what every reader of a growing map does."""

import zlib

import numpy as np
import pytest

from chefbotd.components.maps.events import MapChanged
from chefbotd.core.geometry import Pose2D
from chefbotd.core.grid_patch import GridAssembler, GridPatch, patch_of
from chefbotd.core.record import replace


def patch(revision: int, cells: list[list[int]], row: int = 0, column: int = 0) -> GridPatch:
    """A patch of a grid of 2 rows by 3 columns."""
    fields = {
        "stamp_s": 1.0,
        "revision": revision,
        "resolution_m": 0.05,
        "map_from_grid": Pose2D(-1.0, 0.5, 0.1),
    }
    return patch_of(GridPatch, np.array(cells, np.int8), row, column, columns=3, rows=2, **fields)


WHOLE = patch(5, [[-1, 0, 100], [5, 6, 7]])


def cells(assembler: GridAssembler) -> list[int]:
    """All cells, from the lowest y up."""
    return np.frombuffer(assembler.cells, np.int8).tolist()


def test_a_patch_has_the_cells_that_it_was_made_of() -> None:
    """Two columns out of a larger array, which do not lie one after the other in memory."""
    grid = np.arange(12, dtype=np.int8).reshape(3, 4)
    made = patch_of(
        MapChanged,
        grid[1:, 1:3],
        1,
        1,
        stamp_s=1.0,
        revision=1,
        resolution_m=0.05,
        map_from_grid=Pose2D(),
        columns=4,
        rows=3,
        whole=False,
    )
    assert (made.row, made.column, made.part_rows, made.part_columns) == (1, 1, 2, 2)
    assert made.unpacked() == bytes([5, 6, 9, 10])


def test_patches_are_put_where_they_belong() -> None:
    """A whole one, then the upper right corner and the middle column."""
    grid = GridAssembler()
    assert not grid.add(patch(4, [[9]]), whole=False), "nothing is known yet"
    assert grid.add(WHOLE, whole=True)
    assert grid.add(patch(6, [[99]], row=1, column=2), whole=False)
    assert grid.add(patch(7, [[1], [2]], column=1), whole=False)
    assert cells(grid) == [-1, 1, 100, 5, 2, 99]


def test_after_a_gap_nothing_is_taken_until_a_whole_grid_comes() -> None:
    """Cells that changed in the patch that is missing would be wrong for as long as nobody saw them again."""
    grid = GridAssembler()
    grid.add(WHOLE, whole=True)
    assert not grid.add(patch(7, [[9]]), whole=False)
    assert not grid.add(patch(8, [[9]]), whole=False)
    assert cells(grid) == [-1, 0, 100, 5, 6, 7]
    assert grid.add(replace(WHOLE, revision=1), whole=True), "a new worker counts from 1 on"
    assert grid.add(patch(2, [[8]]), whole=False)
    assert cells(grid) == [8, 0, 100, 5, 6, 7]


@pytest.mark.parametrize(
    ("wrong", "whole"),
    [
        ({"cells": b"!"}, True),
        ({"cells": zlib.compress(bytes(7))}, True),
        ({"cells": zlib.compress(bytes(5))}, True),
        ({"rows": 3}, True),
        ({"row": 1}, True),
        ({"row": 1}, False),
        ({"column": 1}, False),
        ({"column": -1}, False),
        ({"rows": 3}, False),
    ],
)
def test_a_patch_that_is_not_what_it_says_changes_nothing(wrong: dict[str, object], whole: bool) -> None:
    """Cells that cannot be unpacked, too many, too few; a place outside of the grid; another grid."""
    grid = GridAssembler()
    grid.add(WHOLE, whole=True)
    with pytest.raises(ValueError, match=r"cells|outside"):
        grid.add(replace(WHOLE, revision=6, **wrong), whole=whole)
    assert cells(grid) == [-1, 0, 100, 5, 6, 7]
    assert grid.add(patch(6, [[3]]), whole=False)
