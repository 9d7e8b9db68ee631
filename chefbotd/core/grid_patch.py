"""A patch of a grid of cells, and the grid that patches make. Loads no numpy."""

import zlib
from typing import TYPE_CHECKING, Any, TypeVar

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

P = TypeVar("P", bound="GridPatch")


class GridPatch(Record, frozen=True):
    """``part_rows`` by ``part_columns`` cells of a grid in the map, from (``row``, ``column``) on.

    ``cells`` are a signed byte each, row by row from the lowest y up, compressed by zlib. ``map_from_grid`` is where the
    outer corner of the grid's first cell lies.
    """

    stamp_s: float
    revision: int
    resolution_m: float
    map_from_grid: Pose2D
    columns: int
    rows: int
    column: int
    row: int
    part_columns: int
    part_rows: int
    cells: bytes

    def unpacked(self) -> bytes:
        """The cells.

        Raises:
            ValueError: they cannot be unpacked, or are not as many as it says.
        """
        expected = self.part_rows * self.part_columns
        try:
            data = zlib.decompressobj().decompress(self.cells, expected + 1)
        except zlib.error as error:
            raise ValueError(f"the cells cannot be unpacked: {error}") from error
        if len(data) != expected:
            raise ValueError(f"{expected} cells were expected, but at least {len(data)} arrived")
        return data


def patch_of(kind: type[P], cells: "NDArray[np.int8]", row: int, column: int, **fields: Any) -> P:
    """The patch with these cells from (``row``, ``column``) on; ``fields`` are the others of its class."""
    rows, columns = cells.shape
    packed = zlib.compress(cells.tobytes(), 1)
    return kind(row=row, column=column, part_rows=rows, part_columns=columns, cells=packed, **fields)


class GridAssembler:
    """A grid put together from its patches; one that does not follow the last is excluded, until a whole one comes."""

    def __init__(self) -> None:
        self._cells = bytearray()
        self._shape = (0, 0)
        self._revision: int | None = None

    @property
    def cells(self) -> bytes:
        """A signed byte for each cell, row by row from the lowest y up."""
        return bytes(self._cells)

    def add(self, patch: GridPatch, *, whole: bool) -> bool:
        """Take in a patch, or all of the grid (``whole``); False: the patch before it is missing.

        Raises:
            ValueError: the patch is not what it says it is.
        """
        shape, part = (patch.rows, patch.columns), patch.unpacked()
        if whole:
            if (patch.row, patch.column, patch.part_rows, patch.part_columns) != (0, 0, *shape):
                raise ValueError("a whole grid has all of its cells")
            self._cells, self._shape = bytearray(part), shape
        elif self._revision is None or patch.revision != self._revision + 1:
            return False
        else:
            self._place_patch(patch, shape, part)
        self._revision = patch.revision
        return True

    def _place_patch(self, patch: GridPatch, shape: tuple[int, int], part: bytes) -> None:
        width, lasts = patch.part_columns, (patch.row + patch.part_rows, patch.column + patch.part_columns)
        if (
            shape != self._shape
            or min(patch.row, patch.column) < 0
            or lasts[0] > shape[0]
            or lasts[1] > shape[1]
        ):
            raise ValueError("a part lies outside of the map")
        for row in range(patch.part_rows):
            at = (patch.row + row) * shape[1] + patch.column
            self._cells[at : at + width] = part[row * width : (row + 1) * width]
