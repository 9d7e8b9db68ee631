"""Keep-out and slow zones: polygons on the map, from a YAML file beside it.

::

    keep_out:
      - {name: stairs, corners_m: [[0, 0], [1, 0], [1, 2]]}
    slow:
      - {name: by the counter, corners_m: [[3, 0], [5, 0], [5, 2]], max_speed_m_s: 0.1}
"""

from typing import Annotated

import numpy as np
from pydantic import Field, ValidationError

from chefbotd.components.navigation.algorithms.grid import Flags, Floats, GridFrame
from chefbotd.core.bounded_yaml import load_first_document
from chefbotd.core.parameters import Parameters

MOST_CELL_TESTS = 2_000_000_000
"""Of an edge and a cell beside it: some seconds of one processor."""
MOST_PROBLEMS = 5
MOST_ZONES = 1000

FARTHEST_M = 1e6

Coordinate = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
Corners = Annotated[tuple[tuple[Coordinate, Coordinate], ...], Field(min_length=3, max_length=1000)]


class Zone(Parameters):
    """A polygon in the map's frame, its corners in either order."""

    name: str = Field(default="", max_length=100)
    corners_m: Corners


class SlowZone(Zone):
    """Here the robot drives no faster than this."""

    max_speed_m_s: float = Field(gt=0, le=10)


class Zones(Parameters):
    """All zones of a map; none by default."""

    keep_out: tuple[Zone, ...] = Field((), max_length=MOST_ZONES)
    slow: tuple[SlowZone, ...] = Field((), max_length=MOST_ZONES)


NO_ZONES = Zones()


def parse_zones(text: str, name: str) -> Zones:
    """The YAML text of the file called ``name``.

    Raises:
        ValueError: it is no YAML or holds no zones; its text names the file and what was expected.
    """
    try:
        return Zones.model_validate(load_first_document(text) or {})
    except ValidationError as error:
        problems = [
            f"{'.'.join(map(str, e['loc']))}: {e['msg']} (got {e['input']!r})" for e in error.errors()
        ]
        raise ValueError(f"{name}: {'; '.join(problems[:MOST_PROBLEMS])}") from error
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error


def require_affordable(zones: Zones, frame: GridFrame) -> None:
    """Check that the zones can be drawn on a map in a moment.

    Raises:
        ValueError: they have too many or too long edges for a map of this size.
    """
    height_m = frame.rows * frame.resolution_m
    cost = 0
    for zone in (*zones.keep_out, *zones.slow):
        up_m = frame.to_grid(np.array(zone.corners_m))[:, 1]
        spans_m = np.abs(np.clip(up_m, 0, height_m) - np.clip(np.roll(up_m, -1), 0, height_m))
        cost += int(np.sum(spans_m / frame.resolution_m + 1.0)) * frame.columns
    if cost > MOST_CELL_TESTS:
        raise ValueError(
            f"zones with {cost / MOST_CELL_TESTS:.0f} times as many and as long edges as can be drawn on a map of "
            f"{frame.columns} by {frame.rows} cells: use fewer corners"
        )


def keep_out_cells(zones: Zones, frame: GridFrame) -> Flags:
    """The cells whose middle is in a keep-out zone, (rows, columns)."""
    cells = np.zeros((frame.rows, frame.columns), np.bool_)
    for zone in zones.keep_out:
        cells |= _inside(frame.to_grid(np.array(zone.corners_m)), frame)
    return cells


def speed_limits_m_s(zones: Zones, frame: GridFrame) -> Floats:
    """For each cell how fast its zones let the robot go: infinite where there is none."""
    limits = np.full((frame.rows, frame.columns), np.inf)
    for zone in zones.slow:
        inside = _inside(frame.to_grid(np.array(zone.corners_m)), frame)
        limits[inside] = np.minimum(limits[inside], zone.max_speed_m_s)
    return limits


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
