"""Free-standing things of the map that were taken away: beams of lidars pass through all of each.

What joins a wall is never taken for gone: it may be a door or a pane of glass, through which a lidar sees. Neither is a
thin thing that stands free, which may be a pane as well, nor one that a range sensor hears where no beam ends.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from chefbotd.components.navigation.algorithms.grid import Flags, Floats, GridFrame
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.record import Record

Cells = NDArray[np.int64]
Counts = NDArray[np.uint8]

LARGEST_M: Final = 1.5
"""A thing is no longer and no wider than this."""

PANE_THIN_M, PANE_LONG_M = 0.1, 0.15
"""Twice the standard deviations of a thing's cells: thinner than the one and longer than the other is like a pane."""

SEEN_WITHIN_M: Final = 2.5
"""Farther away, the beams of a lidar pass beside the leg of a table."""

BEYOND_CELLS: Final = 2.0
"""A beam went through a cell if it ended so far beyond it."""

PASSES: Final = 8
"""A cell is free when beams went through it in so many turns, and none ended at it since;"""

FREE_SHARE: Final = 0.95
"""a thing is gone when so many of its cells are free,"""

APART_M: Final = 0.25
"""and when beams went through it from places so far apart."""

IN_ONE_TURN: Final = 0.3
"""A turn sees through a thing if its beams went through so many of its cells."""

THERE_TURNS: Final = 3
"""After beams ended at it in so many turns, and went through in none, a thing is there."""

BACK_TURNS: Final = 100
"""After so many, something is where a thing was gone."""


class Things(Record, frozen=True):
    """The cells (n, 2) of all things, and the number of the thing of each; where the things are, and their radii.

    What was seen is filled in place: in how many turns beams went through each cell; for each thing from where that was
    first and whether from elsewhere too, in how many turns beams ended at it, and whether it is of glass.
    """

    cells: Cells
    thing: Cells
    centers_m: Floats
    radius_m: Floats
    passes: Counts
    first_m: Floats
    from_elsewhere: Flags
    ended: Counts
    is_glass: Flags


def find_things(walls: Flags, frame: GridFrame) -> Things:
    """The free-standing things among the walls of a map."""
    labels, _ = ndimage.label(walls, structure=np.ones((3, 3), np.int64))
    most = LARGEST_M / frame.resolution_m
    boxes = ndimage.find_objects(labels)
    small = [k + 1 for k, box in enumerate(boxes) if all(part.stop - part.start <= most for part in box)]
    number = np.full(len(boxes) + 1, -1)
    number[small] = np.arange(len(small))
    rows, columns = np.nonzero(walls)
    thing = number[labels[rows, columns]]
    cells, thing = np.stack([rows, columns], axis=1)[thing >= 0], thing[thing >= 0]
    return _without_panes(cells, thing, len(small), frame.resolution_m)


def _without_panes(cells: Cells, thing: Cells, count: int, cell_m: float) -> Things:
    y, x = ((cells + 0.5) * cell_m).T
    size = np.maximum(np.bincount(thing, minlength=count), 1)
    mean_x, mean_y = (np.bincount(thing, value, count) / size for value in (x, y))
    dx, dy = x - mean_x[thing], y - mean_y[thing]
    xx, yy, xy = (np.bincount(thing, value, count) / size for value in (dx * dx, dy * dy, dx * dy))
    middle, off = (xx + yy) / 2, np.sqrt(((xx - yy) / 2) ** 2 + xy * xy)
    thin_m, long_m = 2 * np.sqrt(np.maximum(middle - off, 0)), 2 * np.sqrt(middle + off)
    kept = (thin_m >= PANE_THIN_M) | (long_m <= PANE_LONG_M)
    radius_m = np.zeros(count)
    np.maximum.at(radius_m, thing, np.hypot(dx, dy))
    number = np.where(kept, np.cumsum(kept) - 1, -1)
    of_kept = kept[thing]
    return _nothing_seen(
        cells[of_kept],
        number[thing[of_kept]],
        np.stack([mean_x, mean_y], axis=1)[kept],
        radius_m[kept] + cell_m / 2,
    )


def _nothing_seen(cells: Cells, thing: Cells, centers_m: Floats, radius_m: Floats) -> Things:
    n, count = len(cells), len(centers_m)
    return Things(
        cells, thing, centers_m, radius_m, np.zeros(n, np.uint8), np.full((count, 2), np.nan),
        np.zeros(count, np.bool_), np.zeros(count, np.uint8), np.zeros(count, np.bool_),
    )  # fmt: skip


def forgotten(things: Things) -> Things:
    """Nothing was seen of them yet, apart from glass."""
    fresh = _nothing_seen(things.cells, things.thing, things.centers_m, things.radius_m)
    fresh.is_glass[:] = things.is_glass
    return fresh


def carried_over(before: Things, gone: Flags, things: Things) -> tuple[Things, Flags]:
    """Things of another drawing of the map, with what was seen of those that have the same cells; and which are gone."""
    is_gone = np.zeros(len(things.centers_m), np.bool_)
    number_before = {
        before.cells[before.thing == thing].tobytes(): thing for thing in range(len(before.centers_m))
    }
    for thing in range(len(things.centers_m)):
        own = things.thing == thing
        same = number_before.get(things.cells[own].tobytes())
        if same is None:
            continue
        things.passes[own] = before.passes[before.thing == same]
        for now, then in (
            (things.first_m, before.first_m), (things.from_elsewhere, before.from_elsewhere),
            (things.ended, before.ended), (things.is_glass, before.is_glass), (is_gone, gone),
        ):  # fmt: skip
            now[thing] = then[same]
    return things, is_gone


def see_through(things: Things, frame: GridFrame, sensors_m: Floats, points_m: Floats) -> None:
    """One turn of a lidar: sensors (n, 2), or one for all, and the points where its beams ended, in the grid's frame."""
    if not len(points_m) or not len(things.cells):
        return
    from_m = sensors_m[0]
    reach = int(SEEN_WITHIN_M / frame.resolution_m)
    corner = np.floor(from_m[::-1] / frame.resolution_m).astype(np.int64) - reach
    at = things.cells - corner
    near = np.flatnonzero(((at >= 0) & (at <= 2 * reach)).all(axis=1))
    if not len(near):
        return
    index = np.full((2 * reach + 1, 2 * reach + 1), -1, np.int64)
    index[at[near, 0], at[near, 1]] = near
    went, ended = np.zeros(len(things.cells), np.bool_), np.zeros(len(things.cells), np.bool_)
    _trace(index, corner, frame.resolution_m, sensors_m, points_m, went, ended)
    _count(things, from_m, near, went, ended)


def _count(things: Things, from_m: Floats, near: Cells, went: Flags, ended: Flags) -> None:
    of_near, count = things.thing[near], len(things.centers_m)
    share = np.bincount(of_near, went[near], count) / np.maximum(np.bincount(of_near, minlength=count), 1)
    has_end = np.bincount(of_near, ended[near], count) > 0
    through = (share >= IN_ONE_TURN) & ~has_end
    np.add(things.passes, 1, out=things.passes, where=went & (things.passes < PASSES))
    things.passes[near[has_end[of_near]]] = 0
    np.add(things.ended, 1, out=things.ended, where=has_end & (things.ended < BACK_TURNS))
    things.ended[through] = 0
    things.first_m[has_end], things.from_elsewhere[has_end] = np.nan, False
    is_first = through & np.isnan(things.first_m[:, 0])
    things.first_m[is_first] = from_m
    apart_m = np.hypot(*(things.first_m - from_m).T)
    things.from_elsewhere[through & (apart_m >= APART_M)] = True


@kernel
def _trace(
    index: Cells, corner: Cells, cell_m: float, sensors: Floats, points: Floats, went: Flags, ended: Flags
) -> None:
    rows, columns = index.shape
    for i in range(points.shape[0]):
        end_x, end_y = points[i, 0] / cell_m - corner[1], points[i, 1] / cell_m - corner[0]
        row, column = int(np.floor(end_y)), int(np.floor(end_x))
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for c in range(max(column - 1, 0), min(column + 2, columns)):
                if index[r, c] >= 0:
                    ended[index[r, c]] = True
        s = min(i, sensors.shape[0] - 1)
        x, y = sensors[s, 0] / cell_m - corner[1], sensors[s, 1] / cell_m - corner[0]
        dx, dy = end_x - x, end_y - y
        length = np.hypot(dx, dy)
        if length <= BEYOND_CELLS:
            continue
        for k in range(int(2.0 * min(length - BEYOND_CELLS, rows))):
            column, row = int(np.floor(x + 0.5 * k * dx / length)), int(np.floor(y + 0.5 * k * dy / length))
            if not (0 <= row < rows and 0 <= column < columns):
                break
            if index[row, column] >= 0:
                went[index[row, column]] = True


def hear(things: Things, frame: GridFrame, place_m: Floats, within_m: float) -> None:
    """A range sensor hears something at a place of the grid's frame: a thing there that beams go through is of glass."""
    if not len(things.cells):
        return
    away_m = np.hypot(*((things.cells[:, ::-1] + 0.5) * frame.resolution_m - place_m).T)
    heard = np.zeros(len(things.centers_m), np.bool_)
    heard[things.thing[away_m <= within_m]] = True
    things.is_glass[heard & ~np.isnan(things.first_m[:, 0])] = True


def find_gone(things: Things, was_gone: Flags) -> Flags:
    """Which things are gone; those that were remain so until something is there for a while."""
    count = len(things.centers_m)
    size = np.maximum(np.bincount(things.thing, minlength=count), 1)
    free = np.bincount(things.thing, things.passes >= PASSES, count) / size >= FREE_SHARE
    gone: Flags = (free & things.from_elsewhere) | (was_gone & (things.ended < BACK_TURNS))
    return gone & ~things.is_glass
