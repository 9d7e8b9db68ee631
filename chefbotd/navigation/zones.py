"""Keep-out and slow zones: polygons on the map, from a YAML file beside it.

::

    keep_out:
      - {name: stairs, corners_m: [[0, 0], [1, 0], [1, 2]]}
    slow:
      - {name: by the counter, corners_m: [[3, 0], [5, 0], [5, 2]], max_speed_m_s: 0.1}
"""

from typing import Annotated, Any

import numpy as np
import yaml
from pydantic import Field, ValidationError

from chefbotd.core.parameters import Parameters
from chefbotd.navigation.grid import Flags, Floats, GridFrame

Corners = Annotated[tuple[tuple[float, float], ...], Field(min_length=3, max_length=1000)]


class Zone(Parameters):
    """A polygon in the map's frame, its corners in either order."""

    name: str = Field(default="", max_length=100)
    corners_m: Corners


class SlowZone(Zone):
    """Here the robot drives no faster than this."""

    max_speed_m_s: float = Field(gt=0, le=10)


class Zones(Parameters):
    """All zones of a map; none by default."""

    keep_out: tuple[Zone, ...] = ()
    slow: tuple[SlowZone, ...] = ()


NO_ZONES = Zones()


def parse_zones(text: str, name: str) -> Zones:
    """The YAML text of the file called ``name``.

    Raises:
        ValueError: it is no YAML or holds no zones; its text names the file and what was expected.
    """
    try:
        values: Any = yaml.safe_load(text) or {}
        return Zones.model_validate(values)
    except yaml.YAMLError as error:
        raise ValueError(f"{name}: not valid YAML: {' '.join(str(error).split())}") from error
    except ValidationError as error:
        problems = [
            f"{'.'.join(map(str, e['loc']))}: {e['msg']} (got {e['input']!r})" for e in error.errors()
        ]
        raise ValueError(f"{name}: {'; '.join(problems)}") from error


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
    """Even-odd rule, for all cells at once."""
    x = (np.arange(frame.columns)[None, :] + 0.5) * frame.resolution_m
    y = (np.arange(frame.rows)[:, None] + 0.5) * frame.resolution_m
    inside = np.zeros((frame.rows, frame.columns), np.bool_)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if ay != by:
            inside ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / (by - ay))
    return inside
