"""Where the walls come from: a furnished room, or a map in the format of ROS's map_server."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image
from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.sim.arrays import Vector
from chefbotd.sim.world import World


class MapParameters(Parameters):
    """A map_server YAML (https://wiki.ros.org/map_server); ``origin`` is the lower left pixel: x, y, yaw."""

    image: str
    resolution: float = Field(gt=0)
    origin: tuple[float, float, float]
    negate: bool = False
    occupied_thresh: float = Field(0.65, ge=0, le=1)
    free_thresh: float = Field(0.196, ge=0, le=1)
    mode: str = "trinary"


def default_room() -> World:
    """A 4.2 m square room with furniture along its walls.

    The square from (0, 0) to (2, 2) is at least 0.6 m from everything, and what lies ahead when driving along
    it is never beyond the ultrasonic sensor's 4 m.
    """
    room = _box(-1.1, -1.1, 3.1, 3.1)
    cupboard = _box(2.7, 0.2, 3.1, 1.4)
    sofa = _box(0.0, 2.7, 1.6, 3.1)
    shelf = _box(-1.1, -1.1, -0.65, 0.3)
    table_legs = [
        wall
        for x, y in ((1.2, -1.0), (1.8, -1.0), (1.2, -0.75), (1.8, -0.75))
        for wall in _box(x, y, x + 0.05, y + 0.05)
    ]
    stove = _box(-1.1, 2.65, -0.65, 3.1)
    return World([*room, *cupboard, *sofa, *shelf, *table_legs, *stove])


def _box(left: float, bottom: float, right: float, top: float) -> list[tuple[float, float, float, float]]:
    corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    return [(*corners[k], *corners[(k + 1) % 4]) for k in range(4)]


def load_map(path: Path) -> World:
    """The walls of the map whose YAML file this is; its image lies beside it.

    Raises:
        OSError: a file cannot be read.
        ValueError: the YAML or the image is not a map, or nothing in it is occupied.
    """
    parameters = MapParameters.model_validate(_flat_yaml(path.read_text(encoding="utf-8")))
    with Image.open(path.parent / parameters.image) as image:
        pixels = np.asarray(image.convert("L"), dtype=np.float64)
    darkness = pixels / 255 if parameters.negate else 1 - pixels / 255
    occupied = np.flipud(darkness > parameters.occupied_thresh)
    if not occupied.any():
        raise ValueError(f"{path}: no pixel is darker than occupied_thresh {parameters.occupied_thresh}")
    return World(_placed(_outlines(occupied) * parameters.resolution, parameters.origin))


def _flat_yaml(text: str) -> dict[str, Any]:
    """The ``key: value`` lines that map_server files consist of; a value that is not JSON is a string."""
    values: dict[str, Any] = {}
    for line in text.splitlines():
        key, colon, value = line.partition("#")[0].partition(":")
        if colon:
            values[key.strip()] = _scalar(value.strip())
    return values


def _scalar(text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text.strip("'")


def _outlines(occupied: npt.NDArray[np.bool_]) -> Vector:
    """Segments around the occupied cells, in cells from the lower left corner; rows go up, columns right."""
    padded = np.pad(occupied, 1)
    level = _edge_runs(padded)
    upright = _edge_runs(padded.T)
    return np.concatenate((level, upright[:, [1, 0, 3, 2]]))


def _edge_runs(padded: npt.NDArray[np.bool_]) -> Vector:
    """The straight runs along axis 1 where a cell and its neighbour along axis 0 differ: x1, y, x2, y."""
    edges = (padded[1:] != padded[:-1]).astype(np.int8)
    steps = np.diff(edges, axis=1)
    starts, stops = np.argwhere(steps == 1), np.argwhere(steps == -1)
    y = starts[:, 0]
    return np.stack((starts[:, 1], y, stops[:, 1], y), axis=1).astype(np.float64)


def _placed(walls: Vector, origin: tuple[float, float, float]) -> Vector:
    """The walls turned by the origin's yaw and moved to it."""
    x, y, yaw = origin
    cos, sin = math.cos(yaw), math.sin(yaw)
    turned = walls.reshape(-1, 2) @ np.array([[cos, sin], [-sin, cos]])
    moved: Vector = turned + np.array([x, y])
    return moved.reshape(-1, 4)
