"""Makes an occupancy grid from scans at the graph's poses: per cell, the share of beams that ended there.

A beam clears what it passes. So a person who walked through leaves no smear: where one beam ended at a leg, many
went on to the wall before and after.
"""

import math
from collections.abc import Sequence

import numpy as np

from chefbotd.components.mapping.algorithms.local_map import MOST, Counts, clear
from chefbotd.components.mapping.algorithms.state import Nodes, Scan
from chefbotd.components.mapping.algorithms.surfaces import places
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import UNKNOWN, OccupancyGrid
from chefbotd.core.poses import Floats, transform
from chefbotd.core.record import Record

RESOLUTION_M = 0.05
MARGIN_M = 0.5
END_WEIGHT = 4.0
"""An end says more than a pass: beams graze the cells along a wall, but none ends in free space."""

STRAY_SHARE = 0.2
"""Where so much fewer beams ended than in a cell beside it, they are that one's noise, and often beyond its wall."""

LEAST_OBSERVATIONS = 2
"""What fewer beams than this reached stays unknown."""


def occupancy(nodes: Nodes, resolution_m: float = RESOLUTION_M) -> OccupancyGrid:
    """The map of all kept scans of the first part, at the poses of the graph.

    Raises:
        ValueError: there are no scans in it.
    """
    scans = [place_scan(nodes.map[k], nodes.scans[k]) for k in np.flatnonzero(nodes.part == 0)]
    if not scans:
        raise ValueError("a map is made of scans, but there are none")
    low, high = extent_m(scans)
    low, high = low - MARGIN_M, high + MARGIN_M
    origin_m = np.floor(low / resolution_m) * resolution_m
    columns, rows = (math.ceil(size) for size in (high - origin_m) / resolution_m)
    seen = np.zeros((rows, columns, 2), np.uint16)
    for scan in scans:
        trace(seen, scan.from_m - origin_m, scan.points_m - origin_m, resolution_m)
    return OccupancyGrid(resolution_m, Pose2D(float(origin_m[0]), float(origin_m[1])), percent_of(seen))


class Placed(Record, frozen=True):
    """A scan in the map: the sensor's place, one or one for each point, and the points, (n, 2) each."""

    from_m: Floats
    points_m: Floats


def place_scan(pose: Floats, scan: Scan) -> Placed:
    """A scan that was taken at this pose."""
    return Placed(transform(pose, places(scan.sensor_m)), transform(pose, scan.points))


def extent_m(scans: Sequence[Placed]) -> tuple[Floats, Floats]:
    """The least and the largest x and y of the scans, of which there is one at least."""
    everything = [part for scan in scans for part in (scan.from_m, scan.points_m) if len(part)]
    low: Floats = np.min([part.min(axis=0) for part in everything], axis=0)
    high: Floats = np.max([part.max(axis=0) for part in everything], axis=0)
    return low, high


def percent_of(seen: Counts) -> np.ndarray[tuple[int, ...], np.dtype[np.int8]]:
    """Each cell's percentage, of how many beams ended in it and how many passed (rows, columns, 2)."""
    ends, passes = seen[..., 0].astype(np.float64), seen[..., 1].astype(np.float64)
    stray = ends < STRAY_SHARE * _most_about(ends)
    ends = END_WEIGHT * np.where(stray, 0, ends)
    is_known = (seen.sum(axis=2, dtype=np.int64) >= LEAST_OBSERVATIONS) & ~(stray & (passes == 0))
    share = np.divide(ends, ends + passes, out=np.zeros_like(passes), where=is_known)
    return np.where(is_known, np.rint(100 * share), UNKNOWN).astype(np.int8)


def _most_about(ends: Floats) -> Floats:
    """The largest number in each cell's neighbourhood of three by three."""
    rows = np.pad(ends, 1)
    across = np.maximum(np.maximum(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:])
    return np.asarray(np.maximum(np.maximum(across[:-2], across[1:-1]), across[2:]))


@kernel
def trace(seen: Counts, from_m: Floats, points_m: Floats, cell_m: float) -> None:
    """Count the ends and the passes of a scan, seen from one place or from one for each point."""
    last = from_m.shape[0] - 1
    for i in range(points_m.shape[0]):
        s = min(i, last)
        clear(seen, cell_m, from_m[s, 0], from_m[s, 1], points_m[i, 0], points_m[i, 1])
        row, column = int(points_m[i, 1] / cell_m), int(points_m[i, 0] / cell_m)
        if seen[row, column, 0] < MOST:
            seen[row, column, 0] += 1
