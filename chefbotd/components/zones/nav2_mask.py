"""Reads a mask of Nav2's costmap filters as zones: which cells are kept out of, and where it is driven slowly.

Source: https://docs.nav2.org, "Costmap Filter Info Server", "Navigating with Keepout Zones" and "Navigating with Speed
Limits", and nav2_msgs/CostmapFilterInfo: the value of a cell of 0 to 100 stands for base + multiplier * value. Of a
keepout filter 100 is not to be entered, and less is only dearer; of a speed filter it is a speed, and a cell of 0 has
no limit. What is unknown says nothing.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.maps.storage.contents import read_map_server
from chefbotd.components.zones.algorithms.trace import trace_areas
from chefbotd.components.zones.models import MOST_ADDED, MOST_ADDED_POINTS
from chefbotd.core.record import Record

KEPT_OUT: Final = 100.0
LEAST_TURN_RAD: Final = 1e-6
FASTEST_M_S: Final = 10.0
MOST_RUNS: Final = 100_000
MOST_CORNERS: Final = 120
"""Of an area, so that it fits into a request."""


class MaskError(ValueError):
    """The mask cannot be drawn as zones; the text says why, and what to do."""


class FilterInfo(Record, frozen=True):
    """What Nav2's CostmapFilterInfo says of a mask, and the speed of which a speed filter may tell a share."""

    base: float = 0.0
    multiplier: float = 1.0
    percent_of_m_s: float | None = None


class MaskZones(Record, frozen=True):
    """The zones as ``add_zones`` takes them; ``notes`` say, for people, what of the mask is not in them."""

    zones: tuple[dict[str, Any], ...]
    notes: tuple[str, ...] = ()


def read_mask(path: Path, kind: str, info: FilterInfo) -> MaskZones:
    """The zones of a mask's YAML file and of the image that it names; ``kind`` is keepout or speed.

    Raises:
        MaskError: the origin is turned, nothing is in it, or its values are no speeds.
        MapStoreError: a file cannot be read.
    """
    read = read_map_server(path)
    grid, origin = read.grid, read.grid.map_from_grid
    if abs(origin.heading_rad) > LEAST_TURN_RAD:
        raise MaskError(
            f"{path.name}: its origin is turned by {origin.heading_rad:g} rad, and Nav2 takes no turned mask: "
            "draw it along the axes of the map, with an origin of yaw 0"
        )
    percent = grid.percent
    if kind == "keepout":
        values = info.base + info.multiplier * percent
        is_kept_out = (percent >= 0) & (values >= KEPT_OUT)
        dearer = int(((percent > 0) & (values > 0) & (values < KEPT_OUT)).sum())
        layers: list[tuple[NDArray[np.bool_], float | None]] = [(is_kept_out, None)]
        notes = (f"{dearer} cells that are only dearer are left out",) if dearer else ()
    else:
        layers, notes = _speeds(percent, info, path.name), ()
    zones: list[dict[str, Any]] = []
    for cells, speed_m_s in layers:
        _require_coherent(cells, path.name)
        for outline in trace_areas(cells, MOST_CORNERS):
            points = outline * grid.resolution_m + np.array([origin.x_m, origin.y_m])
            zones.append(_zone(points, speed_m_s, f"{path.stem} {len(zones) + 1}"))
    _require_some(zones, path.name)
    return MaskZones(tuple(zones), (*read.notes, *notes))


def _require_coherent(cells: NDArray[np.bool_], name: str) -> None:
    """Refuse what would be traced for minutes, and be too many areas then: a mask of noise."""
    runs = int(np.count_nonzero(cells[:, 0]) + np.count_nonzero(cells[:, 1:] & ~cells[:, :-1]))
    if runs > MOST_RUNS:
        raise MaskError(
            f"{name}: its cells lie in {runs} pieces of rows, at most {MOST_RUNS} can be drawn: remove its specks"
        )


def _speeds(
    percent: NDArray[np.int8], info: FilterInfo, name: str
) -> list[tuple[NDArray[np.bool_], float | None]]:
    """The cells of each speed, in m/s."""
    layers: list[tuple[NDArray[np.bool_], float | None]] = []
    for value in np.unique(percent[percent > 0]).tolist():
        speed = info.base + info.multiplier * value
        if info.percent_of_m_s is not None:
            if not 0 < speed <= 100:
                raise MaskError(
                    f"{name}: a cell of {value} stands for {speed:g} % of the speed, not for 0 to 100 %"
                )
            speed *= info.percent_of_m_s / 100
        if not 0 < speed <= FASTEST_M_S:
            raise MaskError(
                f"{name}: a cell of {value} stands for {speed:g} m/s: expected a speed above 0 and up to "
                f"{FASTEST_M_S:g}; give the base and the multiplier of the filter's CostmapFilterInfo, or of which "
                "speed it is a percentage"
            )
        layers.append((percent == value, round(speed, 4)))
    return layers


def _zone(points_m: NDArray[np.float64], speed_m_s: float | None, name: str) -> dict[str, Any]:
    points = [[round(x_m, 4), round(y_m, 4)] for x_m, y_m in points_m.tolist()]
    if speed_m_s is None:
        return {"kind": "keep_out", "name": name, "points_m": points}
    return {"kind": "slow", "name": name, "points_m": points, "max_speed_m_s": speed_m_s}


def _require_some(zones: list[dict[str, Any]], name: str) -> None:
    corners = sum(len(zone["points_m"]) for zone in zones)
    if not zones:
        raise MaskError(
            f"{name}: nothing is in it: no cell stands for an area that is kept out of, or for a speed"
        )
    if len(zones) > MOST_ADDED or corners > MOST_ADDED_POINTS:
        raise MaskError(
            f"{name}: {len(zones)} areas with {corners} corners; at most {MOST_ADDED} with {MOST_ADDED_POINTS} can be "
            "drawn: remove its specks, or smooth it"
        )
