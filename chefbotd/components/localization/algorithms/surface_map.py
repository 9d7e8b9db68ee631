"""What to match scans against, made from an occupancy grid: surfaces with a direction, likelihoods, and what is free.

A surface is where an occupied cell meets a free one. These borders are followed cell by cell, so that the two sides
of a thin wall never mix; a line through some cells on either hand gives the place, finer than a cell, and the side
that faces the free ones. The result is a local map as SLAM has it, so its matching serves here as well.
"""

import math
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.mapping.algorithms.local_map import (
    BLOCK_M,
    CELL_M,
    COARSE_M,
    SURFEL_M,
    LocalMap,
    gather,
    smear,
)
from chefbotd.components.mapping.algorithms.surfaces import Singles
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.poses import Floats, row_of, transform
from chefbotd.core.record import Record

Flags: TypeAlias = NDArray[np.bool_]

NORMAL_X, NORMAL_Y = (1, 0, -1, 0), (0, 1, 0, -1)
"""The four sides of a cell, counter-clockwise."""

STRAIGHT, FLAT = 0.03, 0.12
"""The variance across a line as a share of that along it: up to where it surely is one, and may be one at most."""


OCCUPIED_PERCENT: Final = 65
FREE_PERCENT: Final = 25
DEPTH_CELLS: Final = 0.25
LINE_M: Final = 0.2
"""How far on either side along a border the line through it reaches."""

MOST_CELLS: Final = 6_000_000
"""A larger map, such as 150 by 100 m of 5 cm, takes more memory than the worker may have."""


class Surfaces(Record, frozen=True):
    """Points (n, 2) on the map's surfaces, and which way each faces (zeros where it has no direction)."""

    points: Singles
    facing: Singles


class SurfaceMap(Record, frozen=True):
    """The grids for matching, in ``map``; all surfaces; and the centers of all free cells (n, 2)."""

    grids: LocalMap
    surfaces: Surfaces
    free: Singles


def surface_map(
    grid: OccupancyGrid, *, depth_cells: float = DEPTH_CELLS, most_cells: int = MOST_CELLS
) -> SurfaceMap:
    """The map to match against.

    Raises:
        ValueError: the grid has no place where something occupied meets something free, or is too large.
    """
    if grid.percent.size > most_cells:
        problem = f"has {grid.percent.size} cells, at most {most_cells} are possible: make it again with larger cells"
        raise ValueError(problem)
    occupied = grid.percent >= OCCUPIED_PERCENT
    free = (grid.percent >= 0) & (grid.percent <= FREE_PERCENT)
    surfaces = _place_surfaces(grid, *_borders(grid.resolution_m, occupied, free, depth_cells))
    if not len(surfaces.points):
        raise ValueError("a map for localization needs walls beside free space, but this one has none")
    rows, columns = np.nonzero(free)
    centers = np.stack([columns + 0.5, rows + 0.5], axis=1) * grid.resolution_m
    free_cells = transform(row_of(grid.map_from_grid), centers).astype(np.float32)
    grids = _empty(surfaces.points, free_cells)
    _fill(grids, surfaces.points, surfaces.facing, free_cells, grid.resolution_m)
    return SurfaceMap(grids, surfaces, free_cells)


def _place_surfaces(grid: OccupancyGrid, points: Floats, facing: Floats) -> Surfaces:
    """The surfaces in ``map``, with the grid's turn."""
    origin = row_of(grid.map_from_grid)
    turn = np.array([0.0, 0.0, origin[2]])
    return Surfaces(transform(origin, points).astype(np.float32), transform(turn, facing).astype(np.float32))


def _borders(resolution_m: float, occupied: Flags, free: Flags, depth_cells: float) -> tuple[Floats, Floats]:
    """The points and normals of all borders, in the grid's own frame."""
    padded = np.pad(occupied, 1)
    open_cells = np.pad(free, 1)
    sides = np.stack(
        [padded & np.roll(open_cells, (-NORMAL_Y[side], -NORMAL_X[side]), axis=(0, 1)) for side in range(4)],
        axis=-1,
    )
    cells = np.argwhere(sides)
    points, facing = np.empty((len(cells), 2)), np.zeros((len(cells), 2))
    reach = max(round(LINE_M / resolution_m), 3)
    _lines(padded, cells, reach, points, facing)
    behind = depth_cells * facing
    return (points - behind) * resolution_m, facing


@kernel
def _lines(occupied: Flags, cells: NDArray[np.int64], reach: int, points: Floats, facing: Floats) -> None:
    """Lay a line through each border and those that follow it on either hand, or on one hand only at a corner."""
    chain = np.empty((2 * reach + 1, 4))
    line = np.empty(5)
    for i in range(cells.shape[0]):
        row, column, side = cells[i, 0], cells[i, 1], cells[i, 2]
        _follow(occupied, row, column, side, reach, 1, chain)
        _follow(occupied, row, column, side, reach, -1, chain)
        x, y = chain[reach, 0], chain[reach, 1]
        best = FLAT
        points[i, 0], points[i, 1] = x, y
        for part in range(3):
            first = reach if part == 1 else 0
            last = reach if part == 2 else 2 * reach
            _fit_line(chain, first, last, line)
            if line[4] >= best:
                continue
            best = line[4]
            nx, ny = line[2], line[3]
            off = nx * (line[0] - x) + ny * (line[1] - y)
            points[i, 0], points[i, 1] = x + off * nx, y + off * ny
            facing[i, 0], facing[i, 1] = nx, ny
            if part == 0 and best < STRAIGHT:
                break


@kernel
def _follow(occupied: Flags, row: int, column: int, side: int, reach: int, hand: int, chain: Floats) -> None:
    """Fill one half of ``chain`` (x, y, normal) with the borders that follow, in cells; ``hand`` is 1 or -1.

    What is occupied stays on one side. Cells that touch at a corner are one wall.
    """
    for step in range(reach + 1):
        k = reach + hand * step
        nx, ny = NORMAL_X[side], NORMAL_Y[side]
        chain[k, 0], chain[k, 1] = column - 0.5 + 0.5 * nx, row - 0.5 + 0.5 * ny
        chain[k, 2], chain[k, 3] = nx, ny
        along = (side + hand) % 4
        tx, ty = NORMAL_X[along], NORMAL_Y[along]
        if occupied[row + ny + ty, column + nx + tx]:
            row, column, side = row + ny + ty, column + nx + tx, (along + 2) % 4
        elif occupied[row + ty, column + tx]:
            row, column = row + ty, column + tx
        else:
            side = along


@kernel
def _fit_line(chain: Floats, first: int, last: int, line: Floats) -> None:
    """Fill ``line`` with the mean of the borders, their normal, and the share of the variance that is across."""
    n = last - first + 1.0
    sx = sy = sxx = sxy = syy = ux = uy = 0.0
    for k in range(first, last + 1):
        x, y = chain[k, 0] - chain[first, 0], chain[k, 1] - chain[first, 1]
        sx, sy, sxx, sxy, syy = sx + x, sy + y, sxx + x * x, sxy + x * y, syy + y * y
        ux, uy = ux + chain[k, 2], uy + chain[k, 3]
    xx, xy, yy = sxx / n - (sx / n) ** 2, sxy / n - sx * sy / n / n, syy / n - (sy / n) ** 2
    spread, middle = math.hypot((xx - yy) / 2, xy), (xx + yy) / 2
    turn = 0.5 * math.atan2(2 * xy, xx - yy)
    nx, ny = -math.sin(turn), math.cos(turn)
    if nx * ux + ny * uy < 0.0:
        nx, ny = -nx, -ny
    line[0], line[1] = chain[first, 0] + sx / n, chain[first, 1] + sy / n
    line[2], line[3] = nx, ny
    line[4] = (middle - spread) / max(middle + spread, 1e-9)


def _empty(surfaces: Singles, free: Singles) -> LocalMap:
    """Grids with room for the whole map, and a cell around."""
    both = np.vstack([surfaces, free]).astype(np.float64)
    first = np.floor((both.min(axis=0) - 0.5) / BLOCK_M)
    blocks = (np.ceil((both.max(axis=0) + 0.5) / BLOCK_M) - first).astype(int)
    columns, rows = blocks
    fine, coarse, surfel = (round(BLOCK_M / cell_m) for cell_m in (CELL_M, COARSE_M, SURFEL_M))
    return LocalMap(
        first * BLOCK_M,
        np.zeros((rows * fine, columns * fine), np.uint8),
        np.zeros((rows * coarse, columns * coarse), np.uint8),
        np.zeros((rows * surfel, columns * surfel, 2, 6), np.float32),
        np.zeros((rows * surfel, columns * surfel, 2), np.uint16),
    )


@kernel
def _fill(into: LocalMap, points: Singles, facing: Singles, free: Singles, resolution_m: float) -> None:
    ox, oy = into.origin_m[0], into.origin_m[1]
    for i in range(points.shape[0]):
        x, y = points[i, 0] - ox, points[i, 1] - oy
        smear(into.likelihood, into.coarse, x, y)
        gather(into.surfels, x, y, facing[i, 0], facing[i, 1], 1.0)
        into.seen[int(y / SURFEL_M), int(x / SURFEL_M), 0] = 1
    parts = math.ceil(resolution_m / CELL_M)
    for i in range(free.shape[0]):
        for part in range(parts * parts):
            x = free[i, 0] - ox + ((part % parts + 0.5) / parts - 0.5) * resolution_m
            y = free[i, 1] - oy + ((part // parts + 0.5) / parts - 0.5) * resolution_m
            into.seen[int(y / SURFEL_M), int(x / SURFEL_M), 1] = 1
