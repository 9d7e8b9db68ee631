"""What came of ``chefbotctl map demo``: the map held against the true walls, and what making it cost."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.table import Table

from chefbotd.components.maps.cli.live_view import LiveMapView
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.poses import Floats, row_of, transform
from chefbotd.core.record import Record
from examples.map_demo import DemoResult

LIKELY_OCCUPIED = 65


class WallErrors(Record, frozen=True):
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


def print_report(view: LiveMapView, result: DemoResult, errors: WallErrors, files: list[Path]) -> None:
    """The map, what it is worth, what it cost, and where it lies."""
    view.print(view.drawn(result.grid, result.pose), _table(result, errors))
    view.print("\n".join(map(str, files)), soft_wrap=True)


def _table(result: DemoResult, errors: WallErrors) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_header=False)
    for row in rows(result, errors):
        table.add_row(*row)
    return table


def rows(result: DemoResult, errors: WallErrors) -> list[tuple[str, str]]:
    """What it is worth and what it cost, in words."""
    used, saved = result.processes, result.saved
    return [
        ("walls, off the true ones, median (p95)", f"{errors.median_m:.3f} m ({errors.p95_m:.3f} m)"),
        ("loops closed", str(saved.loops)),
        ("scans kept", f"{saved.keyframes} on {saved.path_m:.0f} m in {result.seconds:.0f} s"),
        *([("late", result.late)] if result.late else []),
        ("control steps missed", f"{result.missed_steps} of {result.control_steps}"),
        ("daemon, with the simulator in it", _cost(used.daemon_cpu, used.daemon_mb)),
        ("worker, which makes the map", _cost(used.worker_cpu, used.worker_mb)),
    ]


def _cost(cpu: float | None, memory_mb: float | None) -> str:
    return f"{_number(cpu, '.2f')} of a core, {_number(memory_mb, '.0f')} MB"


def _number(value: float | None, form: str) -> str:
    return "?" if value is None or not math.isfinite(value) else format(value, form)


def as_json(result: DemoResult, errors: WallErrors, files: list[Path]) -> dict[str, Any]:
    """The same for a script."""
    used = result.processes
    return {
        "name": result.saved.name,
        "files": [str(file) for file in files],
        "walls": {"median_m": errors.median_m, "p95_m": errors.p95_m, "cells": errors.cells},
        "loops": result.saved.loops,
        "keyframes": result.saved.keyframes,
        "path_m": result.saved.path_m,
        "seconds": result.seconds,
        "late": result.late or None,
        "control_steps": result.control_steps,
        "control_steps_missed": result.missed_steps,
        "worker_restarts": result.worker_restarts,
        "daemon": {"cpu": used.daemon_cpu, "rss_mb": used.daemon_mb},
        "worker": {"cpu": used.worker_cpu, "rss_mb": used.worker_mb},
    }
