"""A simulated robot that knows where it is on a map: in a building, or in a room of one's own.

Everything runs on the clock of the running loop. Inside ``chefbotd.clock.run_virtual`` that is faster than real time.
"""

import asyncio
import contextlib
import gc
import tempfile
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from chefbotd.client import Client
from chefbotd.components.maps.algorithms.map_server import (
    MapDescription,
    parse_image,
    to_description,
    to_image,
)
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.simulation.rooms import BUILDINGS
from chefbotd.components.worker.spawn import Spawn
from chefbotd.composition.context import FeatureBuilder
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from chefbotd.testing.worker import worker_in_process

NONE: Final[Mapping[str, Any]] = MappingProxyType({})
SEARCHES_S, CONFIRMS_S = 15.0, 30.0
"""How long it looks around by itself, and how long after it was told where it stands."""


def room_of(picture: Path, resolution_m: float = 0.05) -> OccupancyGrid:
    """A room from a picture, such as a PNG: dark is wall, bright is floor; its lower left corner is the origin.

    Raises:
        OSError, MapFileError: it cannot be read.
    """
    description = MapDescription(image=picture.name, resolution=resolution_m, origin=(0.0, 0.0, 0.0))
    return parse_image(picture.read_bytes(), description)


@contextlib.asynccontextmanager
async def localized_robot(
    world: str | OccupancyGrid = "flat",
    start: Pose2D | None = None,
    places: Mapping[str, Pose2D] = NONE,
    *,
    folder: Path | None = None,
    zones: str = "",
    overrides: Mapping[str, object] = NONE,
    spawn_worker: Spawn = worker_in_process,
    features: Sequence[FeatureBuilder] = (),
    before: Callable[[SimulatedRobot], None] = lambda robot: None,
) -> AsyncIterator[SimulatedRobot]:
    """The packaged ChefBot with a lidar, armed, localized at ``start``, on a map with these places and zones.

    ``world`` is a building (``flat``, ``office``) or a room (``room_of``), whose map is called ``room``; a room needs a
    ``start``. ``folder`` has the map; a temporary one goes with the robot. ``overrides`` change its configuration,
    ``before`` is called with the robot before it localizes itself; the rest is as for ``simulated_robot``.

    Raises:
        ValueError: there is no such building, or a room without a start.
        TimeoutError: it did not find out where it is.
    """
    with contextlib.ExitStack() as stack:
        if folder is None:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="chefbotd-maps-")))
        name, keys, start = _store(world, folder, start, zones)
        keys |= {f"sim.world.start_{key}": value for key, value in _keys(start).items()}
        settings = load(
            packaged("chefbot_lidar"), overrides={"maps.folder": str(folder), **keys, **overrides}
        )
        async with simulated_robot(settings, spawn_worker=spawn_worker, features=features) as robot:
            before(robot)
            await asyncio.sleep(1.5)
            await robot.client.load_map(name)
            await _localize(robot.client, start)
            for place, pose in places.items():
                await robot.client.save_place(place, pose.x_m, pose.y_m, pose.heading_rad)
            with _excluded_from_gc():
                yield robot


@contextlib.contextmanager
def _excluded_from_gc() -> Iterator[None]:
    """No garbage collection looks at what is there already, as in the daemon's own process; that takes a while."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def _keys(pose: Pose2D) -> dict[str, float]:
    return {"x_m": pose.x_m, "y_m": pose.y_m, "heading_rad": pose.heading_rad}


def _store(
    world: str | OccupancyGrid, folder: Path, start: Pose2D | None, zones: str
) -> tuple[str, dict[str, object], Pose2D]:
    """Store the map; its name, what the configuration needs of it, and where the robot stands."""
    keys: dict[str, object] = {}
    if isinstance(world, str):
        if world not in BUILDINGS:
            raise ValueError(f"there is no building {world!r}; there are: {', '.join(BUILDINGS)}")
        name, grid = world, BUILDINGS[world].grid()
        start = start or BUILDINGS[world].start
        keys["sim.world.map_path"] = world
    else:
        name, grid = "room", world
        path = folder / "room.yaml"
        path.write_text(to_description(grid, "room.pgm"))
        (folder / "room.pgm").write_bytes(to_image(grid))
        keys["sim.world.map_path"] = str(path)
    if start is None:
        raise ValueError("a room needs a start")
    store = MapStore(folder, 3)
    if name not in store.names() or not isinstance(world, str):
        save(store, name, grid)
    if zones:
        (folder / f"{name}.map" / "zones.yaml").write_text(zones)
    return name, keys, start


async def _localize(client: Client, start: Pose2D) -> None:
    """It finds out by itself, or else it is told: in a building of equal rooms a search ends at several places."""
    try:
        await _until_localized(client, SEARCHES_S)
    except TimeoutError:
        await client.set_pose(start.x_m, start.y_m, start.heading_rad)
        await _until_localized(client, CONFIRMS_S)


async def _until_localized(client: Client, within_s: float) -> None:
    async with asyncio.timeout(within_s), client.subscribe("localization") as events:
        async for event in events:
            if event.data.state == "localized":
                return
