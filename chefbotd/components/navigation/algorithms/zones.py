"""Draws zones on the grid of a map: the cells that are kept out of, and the speeds that slow zones allow."""

import math
from itertools import pairwise

import numpy as np

from chefbotd.components.navigation.algorithms.grid import Flags, Floats, GridFrame
from chefbotd.components.zones.zone_file import AnyZone, Wall, Zones, outline_m

MOST_CELL_TESTS = 2_000_000_000
"""Of an edge and a cell beside it: some seconds of one processor."""


def require_affordable(zones: Zones, frame: GridFrame) -> None:
    """Check that the zones can be drawn on a map in a moment.

    Raises:
        ValueError: they have too many or too long edges for a map of this size.
    """
    height_m = frame.rows * frame.resolution_m
    cost = 0
    drawn: tuple[AnyZone, ...] = (*zones.keep_out, *zones.slow, *zones.walls)
    for zone in drawn:
        up_m = frame.to_grid(np.array(outline_m(zone), np.float64))[:, 1]
        spans_m = np.abs(np.clip(up_m, 0, height_m) - np.clip(np.roll(up_m, -1), 0, height_m))
        cost += int(np.sum(spans_m / frame.resolution_m + 1.0)) * frame.columns
    if cost > MOST_CELL_TESTS:
        raise ValueError(
            f"zones with {cost / MOST_CELL_TESTS:.0f} times as many and as long edges as can be drawn on a map of "
            f"{frame.columns} by {frame.rows} cells: use fewer corners"
        )


def keep_out_cells(zones: Zones, frame: GridFrame) -> Flags:
    """The cells whose middle is in a keep-out zone or on a drawn wall, (rows, columns)."""
    cells = np.zeros((frame.rows, frame.columns), np.bool_)
    for zone in zones.keep_out:
        if zone.enabled:
            cells |= _inside(frame.to_grid(np.array(zone.corners_m)), frame)
    for wall in zones.walls:
        if wall.enabled:
            _draw_wall(wall, frame, cells)
    return cells


def speed_limits_m_s(zones: Zones, frame: GridFrame) -> Floats:
    """For each cell how fast its zones let the robot go: infinite where there is none. Not to be written to."""
    limits: Floats = np.broadcast_to(np.inf, (frame.rows, frame.columns))  # one number, as for most maps
    for zone in zones.slow:
        if zone.enabled:
            inside = _inside(frame.to_grid(np.array(zone.corners_m)), frame)
            limits = np.where(inside, np.minimum(limits, zone.max_speed_m_s), limits)
    return limits


def _draw_wall(wall: Wall, frame: GridFrame, cells: Flags) -> None:
    """Mark the cells whose middle is within half of its width, and at least every cell that it crosses."""
    cell_m, points = frame.resolution_m, frame.to_grid(np.array(wall.points_m))
    reach_m = max(wall.width_m / 2.0, cell_m * math.sqrt(0.5))
    size = np.array([frame.columns, frame.rows])
    for start, end in pairwise(points):
        low = np.clip(np.floor((np.minimum(start, end) - reach_m) / cell_m), 0, size).astype(int)
        high = np.clip(np.ceil((np.maximum(start, end) + reach_m) / cell_m), 0, size).astype(int)
        x = (np.arange(low[0], high[0])[None, :] + 0.5) * cell_m - start[0]
        y = (np.arange(low[1], high[1])[:, None] + 0.5) * cell_m - start[1]
        dx, dy = end - start
        share = np.clip((x * dx + y * dy) / max(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
        cells[low[1] : high[1], low[0] : high[0]] |= np.hypot(x - share * dx, y - share * dy) <= reach_m


def _inside(corners: Floats, frame: GridFrame) -> Flags:
    """Even-odd rule; of each edge for the rows that it crosses."""
    x = (np.arange(frame.columns)[None, :] + 0.5) * frame.resolution_m
    y = (np.arange(frame.rows)[:, None] + 0.5) * frame.resolution_m
    inside = np.zeros((frame.rows, frame.columns), np.bool_)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if ay != by:
            first, last = np.searchsorted(y[:, 0], sorted((ay, by)))
            part = y[first:last]
            inside[first:last] ^= ((ay > part) != (by > part)) & (
                x < ax + (part - ay) * (bx - ax) / (by - ay)
            )
    return inside
