"""Draws the edits of a map onto its cells, one after the other. Loads no numpy: the daemon draws what it sends, too.

A cell is in an area if its middle is, by the even-odd rule. A wall takes the cells whose middle is within half its
width, and at least those that it crosses.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Final, TypeAlias

from chefbotd.components.map_edits.edit_file import Crop, DrawWall, Erase, MapEdit
from chefbotd.components.maps.storage.manifest import Extent
from chefbotd.core.record import Record

UNKNOWN: Final = 255
"""A cell of -1 as an unsigned byte."""

FREE: Final = 0
OCCUPIED: Final = 100

OPEN: Final = 0
WALL: Final = 1
OUTSIDE: Final = 2
_KEPT: Final = bytes([255]) + bytes(255)
_DRAWN: Final = bytes([0, OCCUPIED, UNKNOWN]) + bytes(253)
AT_ONCE: Final = 1 << 16
"""So many cells are drawn at once: other threads of the daemon have their turn in between."""

Point: TypeAlias = tuple[float, float]
Points: TypeAlias = Sequence[Point]


class DrawnCells(Record, frozen=True):
    """The cells of a map, row by row from the lowest, after all edits.

    ``erased`` are the percentages without what was erased, by which localization finds its way. ``closed`` says of each
    cell whether it is open (0), in a drawn wall (1), or outside of what the map was cropped to (2).
    """

    erased: bytearray
    closed: bytearray

    def shown(self) -> bytes:
        """The percentages as people see them: drawn walls are occupied, and what is outside is unknown."""
        parts = range(0, len(self.erased), AT_ONCE)
        return b"".join(
            _shown(self.erased[start : start + AT_ONCE], self.closed[start : start + AT_ONCE])
            for start in parts
        )


def _shown(erased: bytearray, closed: bytearray) -> bytes:
    """The same of a part, as whole numbers: cells where they are open, and what their marks stand for elsewhere."""
    kept, drawn = closed.translate(_KEPT), closed.translate(_DRAWN)
    cells = int.from_bytes(erased, "big") & int.from_bytes(kept, "big") | int.from_bytes(drawn, "big")
    return cells.to_bytes(len(erased), "big")


def draw_edits(cells: bytes, extent: Extent, edits: Iterable[MapEdit]) -> DrawnCells:
    """The cells of a map of this extent with these edits."""
    erased, closed = bytearray(cells), bytearray(len(cells))
    for edit in edits:
        points = _to_cells(edit.points_m, extent)
        match edit:
            case Erase():
                value = FREE if edit.to == "free" else UNKNOWN
                for start, end in _spans_inside(points, extent):
                    erased[start:end] = bytes([value]) * (end - start)
                    _open_walls(closed, start, end)
            case DrawWall():
                _draw_wall(points, edit.width_m / extent.resolution_m, extent, closed)
            case Crop():
                _close_outside(points, extent, closed)
    return DrawnCells(erased, closed)


def _to_cells(points_m: Points, extent: Extent) -> Points:
    """Points of the map in cells of the grid, whose origin may be turned."""
    cos, sin = math.cos(extent.heading_rad), math.sin(extent.heading_rad)
    away = [(x_m - extent.x_m, y_m - extent.y_m) for x_m, y_m in points_m]
    cell_m = extent.resolution_m
    return [((cos * dx + sin * dy) / cell_m, (cos * dy - sin * dx) / cell_m) for dx, dy in away]


def _spans_inside(corners: Points, extent: Extent) -> Iterator[tuple[int, int]]:
    """The cells inside an area, as (first, end) of the whole array."""
    crossings: dict[int, list[float]] = {}
    for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True):
        first, end = (_first_middle(value, extent.rows) for value in sorted((ay, by)))
        for row in range(first, end):
            crossings.setdefault(row, []).append(ax + (row + 0.5 - ay) * (bx - ax) / (by - ay))
    for row, at in crossings.items():
        at.sort()
        for left, right in zip(at[::2], at[1::2], strict=True):
            start, end = _first_middle(left, extent.columns), _first_middle(right, extent.columns)
            if start < end:
                yield row * extent.columns + start, row * extent.columns + end


def _first_middle(value: float, count: int) -> int:
    """The first of ``count`` cells whose middle is not before a place, in cells."""
    return min(max(math.ceil(min(max(value, -1.0), count + 1.0) - 0.5), 0), count)


def _open_walls(closed: bytearray, start: int, end: int) -> None:
    part = closed[start:end]
    if WALL in part:
        closed[start:end] = part.replace(bytes([WALL]), bytes([OPEN]))


def _close_outside(corners: Points, extent: Extent, closed: bytearray) -> None:
    kept = [(start, end, closed[start:end]) for start, end in _spans_inside(corners, extent)]
    closed[:] = bytes([OUTSIDE]) * len(closed)
    for start, end, before in kept:
        closed[start:end] = before


def _draw_wall(points: Points, width: float, extent: Extent, closed: bytearray) -> None:
    """Mark the cells of a wall that are open, row by row of each stretch."""
    reach = max(width / 2.0, math.sqrt(0.5))
    for a, b in pairwise(points):
        first = _first_middle(min(a[1], b[1]) - reach, extent.rows)
        end = _first_middle(max(a[1], b[1]) + reach, extent.rows)
        for row in range(first, end):
            xs = list(_stretch_in_row(a, b, row + 0.5, reach))
            if not xs:
                continue
            left, right = (_first_middle(x, extent.columns) for x in (min(xs), max(xs)))
            start, stop = row * extent.columns + left, row * extent.columns + right
            closed[start:stop] = closed[start:stop].replace(bytes([OPEN]), bytes([WALL]))


def _stretch_in_row(a: Point, b: Point, y: float, reach: float) -> Iterator[float]:
    """Where a row enters and leaves what is within reach of a line from a to b: two discs, and a box between them."""
    for x_end, y_end in (a, b):
        if (apart := abs(y - y_end)) <= reach:
            half = math.sqrt(reach * reach - apart * apart)
            yield from (x_end - half, x_end + half)
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    if length == 0.0:
        return
    across_x, across_y = -(b[1] - a[1]) / length * reach, (b[0] - a[0]) / length * reach
    box = [(a[0] + across_x, a[1] + across_y), (b[0] + across_x, b[1] + across_y),
           (b[0] - across_x, b[1] - across_y), (a[0] - across_x, a[1] - across_y)]  # fmt: skip
    for (px, py), (qx, qy) in zip(box, [*box[1:], box[0]], strict=True):
        if (py > y) != (qy > y):
            yield px + (y - py) * (qx - px) / (qy - py)
