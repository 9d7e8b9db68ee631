"""How far the walls of a map are from those of the simulated building it was made in."""

from dataclasses import dataclass

import numpy as np

from chefbotd.core.geometry import Pose2D
from chefbotd.mapping.occupancy_grid import OccupancyGrid
from chefbotd.mapping.poses import Floats, row_of, transform

LIKELY_OCCUPIED = 65


@dataclass(frozen=True, slots=True)
class WallErrors:
    """Distances of the occupied cells' centers from the nearest true wall, in metres."""

    cells: int
    median_m: float
    p95_m: float


def wall_errors(grid: OccupancyGrid, world_from_map: Pose2D, edges: Floats) -> WallErrors:
    """Hold a map against true walls, ``edges`` of (x1, y1, x2, y2); ``world_from_map`` is where its robot started.

    Raises:
        ValueError: nothing in the map is occupied.
    """
    rows, columns = np.nonzero(grid.percent >= LIKELY_OCCUPIED)
    if not rows.size:
        raise ValueError("no cell of the map is occupied")
    centers = np.stack([columns + 0.5, rows + 0.5], axis=1) * grid.resolution_m
    placed = transform(row_of(world_from_map.compose(grid.map_from_grid)), centers)
    off_m = np.concatenate(
        [_to_walls_m(part, edges) for part in np.array_split(placed, len(placed) // 500 + 1)]
    )
    return WallErrors(len(rows), float(np.median(off_m)), float(np.percentile(off_m, 95)))


def _to_walls_m(points: Floats, edges: Floats) -> Floats:
    start, along = edges[None, :, :2], (edges[:, 2:] - edges[:, :2])[None]
    here = points[:, None] - start
    share = np.clip((here * along).sum(axis=2) / np.maximum((along * along).sum(axis=2), 1e-12), 0.0, 1.0)
    off = here - share[..., None] * along
    nearest: Floats = np.hypot(off[..., 0], off[..., 1]).min(axis=1)
    return nearest
