"""Sources of walls: a furnished room, a building of `worlds`, or a map in the format of map_server."""

from collections.abc import Collection
from pathlib import Path

import numpy as np
import numpy.typing as npt

from chefbotd.components.maps.algorithms.map_server import parse_description, parse_image
from chefbotd.components.simulation import scene
from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.scene import Scene
from chefbotd.components.simulation.worlds.building import Building
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.components.simulation.worlds.office import OFFICE
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OCCUPIED
from chefbotd.core.poses import row_of, transform

BUILDINGS: dict[str, Building] = {building.name: building for building in (FLAT, OFFICE)}


def scene_of(named: Path | None, closed_doors: Collection[str] = ()) -> Scene:
    """The scene named by ``[sim] world``: a building, the YAML file of a map, or the furnished room.

    Raises:
        OSError: a file cannot be read.
        ValueError: it is not a map, or nothing in it is occupied, or it has no such door.
        ModuleNotFoundError: it is a map, and Pillow is not installed.
    """
    building = None if named is None else BUILDINGS.get(str(named))
    doors = {} if building is None else {door.name: door for door in building.doors}
    if unknown := [name for name in closed_doors if name not in doors]:
        choices = (
            f"there are: {', '.join(doors)}"
            if doors
            else "only a building that comes with chefbotd has doors"
        )
        raise ValueError(f"sim.world.closed_doors: there is no door {unknown[0]!r}; {choices}")
    if building is not None:
        solids = (*building.solids, *[doors[name] for name in closed_doors])
        return scene.of_solids(solids, building.start)
    return scene.of_walls(_furnished_room() if named is None else _map_walls(named))


def _furnished_room() -> Vector:
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
    return np.array([*room, *cupboard, *sofa, *shelf, *table_legs, *stove])


def _box(left: float, bottom: float, right: float, top: float) -> list[tuple[float, float, float, float]]:
    corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    return [(*corners[k], *corners[(k + 1) % 4]) for k in range(4)]


def _map_walls(path: Path) -> Vector:
    """The walls of the map in this YAML file and the image beside it."""
    description = parse_description(path.read_bytes(), str(path))
    grid = parse_image((path.parent / description.image).read_bytes(), description)
    occupied = grid.percent == OCCUPIED
    if not occupied.any():
        raise ValueError(f"{path}: no pixel is darker than occupied_thresh {description.occupied_thresh}")
    return _place_walls(_outlines(occupied) * grid.resolution_m, grid.map_from_grid)


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


def _place_walls(walls: Vector, origin: Pose2D) -> Vector:
    """The walls turned by the origin's heading and moved to it."""
    return transform(row_of(origin), walls.reshape(-1, 2)).reshape(-1, 4)
