"""Draws an occupancy grid as text: two cells in each character, one above the other, with marks on top.

It fits a given number of columns and rows: what lies in one half of a character is drawn as its most occupied cell, so
that no wall disappears. Ground that nobody has seen is cut off around the map. Up is the grid's own y axis.
"""

import math
from collections.abc import Sequence
from itertools import groupby

import numpy as np
import numpy.typing as npt
from rich.text import Text

from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import UNKNOWN, OccupancyGrid
from chefbotd.core.record import Record

Percents = npt.NDArray[np.int8]
Shades = npt.NDArray[np.uint8]

LIKELY_OCCUPIED = 65
"""From this percentage a cell is a wall, as in map_server."""

ROUNDING = 1e-9
"""A size divided by its own scale may come out a little too large."""

ARROWS = "→↗↑↖←↙↓↘"
UPPER, LOWER, FULL, FOG = "▀", "▄", "█", "░"
WALL, SEEN, UNSEEN = 2, 1, 0
COLORS = ("grey30", "grey85", "black")
"""By kind: not seen, free, wall. The same on a dark and on a light terminal."""


class MapMark(Record, frozen=True):
    """Something in the map, in metres of ``map``; one with a heading is an arrow, any other its sign, with its label."""

    x_m: float
    y_m: float
    heading_rad: float | None = None
    label: str = ""
    style: str = "bold blue"
    sign: str = "●"


class MapSection(Record, frozen=True):
    """The part of a grid that is drawn: its first cell, and how many cells one half of a character stands for."""

    row: int
    column: int
    scale: float
    kinds: Shades

    def place(self, grid: OccupancyGrid, mark: MapMark) -> tuple[int, int] | None:
        """The line and the column of a mark, counted from the top left; None outside the picture."""
        x_m, y_m = _in_grid(grid, mark).x_m, _in_grid(grid, mark).y_m
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            return None
        up = math.floor((y_m / grid.resolution_m - self.row) / self.scale)
        column = math.floor((x_m / grid.resolution_m - self.column) / self.scale)
        height, width = self.kinds.shape
        inside = 0 <= up < height and 0 <= column < width
        return ((height - 1 - up) // 2, column) if inside else None


def draw_map(
    grid: OccupancyGrid, columns: int, rows: int, marks: Sequence[MapMark] = (), *, color: bool = True
) -> Text:
    """The grid in at most ``columns`` by ``rows`` characters, the later marks above the earlier ones.

    Without ``color`` walls are blocks, free ground is empty and what was not seen is shaded; with it each character has
    the colours of its two halves.
    """
    view = _view(grid, max(1, columns), max(1, rows))
    lines = [_line(upper, lower, color=color) for upper, lower in _halves(view.kinds)]
    for mark in marks:
        _put(lines, view, grid, mark)
    return Text("\n").join(lines)


def _view(grid: OccupancyGrid, columns: int, rows: int) -> MapSection:
    row, column, percent = _known_part(grid.percent)
    height, width = percent.shape
    scale = max(1.0, width / columns, height / (2 * rows))
    return MapSection(row, column, scale, _shrunk(percent, scale, columns, 2 * rows))


def _known_part(percent: Percents) -> tuple[int, int, Percents]:
    """The smallest rectangle with all cells that are known, and a cell around it; all of a map that knows none."""
    seen = percent != UNKNOWN
    if not seen.any():
        return 0, 0, percent
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    row, column = max(0, int(rows[0]) - 1), max(0, int(columns[0]) - 1)
    return row, column, percent[row : int(rows[-1]) + 2, column : int(columns[-1]) + 2]


def _shrunk(percent: Percents, scale: float, columns: int, rows: int) -> Shades:
    """The kind of each half of a character, the top row first; an odd number of rows has an unseen one above it."""
    edges = [
        np.floor(np.arange(min(most, math.ceil(size / scale - ROUNDING))) * scale).astype(np.int64)
        for size, most in zip(percent.shape, (rows, columns), strict=True)
    ]
    most = np.maximum.reduceat(np.maximum.reduceat(percent, edges[0], axis=0), edges[1], axis=1)
    kinds = np.where(most >= LIKELY_OCCUPIED, WALL, np.where(most == UNKNOWN, UNSEEN, SEEN)).astype(np.uint8)
    if len(kinds) % 2:
        kinds = np.vstack([kinds, np.full((1, kinds.shape[1]), UNSEEN, np.uint8)])
    return np.flipud(kinds)


def _halves(kinds: Shades) -> list[tuple[list[int], list[int]]]:
    rows: list[list[int]] = kinds.tolist()
    return list(zip(rows[::2], rows[1::2], strict=True))


def _line(upper: list[int], lower: list[int], *, color: bool) -> Text:
    if not color:
        return Text("".join(_plain(*pair) for pair in zip(upper, lower, strict=True)))
    line = Text()
    for (above, below), same in groupby(zip(upper, lower, strict=True)):  # few spans: they cost the time
        line.append(UPPER * len(list(same)), f"{COLORS[above]} on {COLORS[below]}")
    return line


def _plain(above: int, below: int) -> str:
    if WALL in (above, below):
        return FULL if above == below else UPPER if above == WALL else LOWER
    return FOG if above == below == UNSEEN else " "


def _put(lines: list[Text], view: MapSection, grid: OccupancyGrid, mark: MapMark) -> None:
    """Write a mark over what is there, its label to the right of it as far as there is room."""
    place = view.place(grid, mark)
    if place is None:
        return
    row, column = place
    sign = mark.sign if mark.heading_rad is None else _arrow(_in_grid(grid, mark).heading_rad)
    text = Text(sign + _printable(mark.label), mark.style)
    text.truncate(len(lines[row]) - column)
    line = lines[row]
    lines[row] = line[:column] + text + line[column + text.cell_len :]


def _printable(label: str) -> str:
    return "".join(character for character in label if character.isprintable())


def _in_grid(grid: OccupancyGrid, mark: MapMark) -> Pose2D:
    return grid.map_from_grid.inverse().compose(Pose2D(mark.x_m, mark.y_m, mark.heading_rad or 0.0))


def _arrow(heading_rad: float) -> str:
    if not math.isfinite(heading_rad):
        return "●"
    return ARROWS[round(heading_rad / (math.pi / 4)) % 8]
