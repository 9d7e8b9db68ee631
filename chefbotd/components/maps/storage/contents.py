"""Converts a grid and SLAM's state to the files of a version, and back. Not for the daemon: it loads numpy."""

import errno
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.maps.algorithms.map_server import (
    FREE_THRESH,
    GREY,
    ImageMode,
    MapDescription,
    MapFileError,
    parse_description,
    parse_image,
    to_description,
    to_image,
)
from chefbotd.components.maps.storage.disk import Content, MapStoreError
from chefbotd.components.maps.storage.manifest import CELLS, DESCRIPTION, GRAPH, IMAGE, Extent
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.core.commands import RefusalKind
from chefbotd.core.occupancy_grid import UNKNOWN, OccupancyGrid
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence
from chefbotd.extras import how_to_add_extra
from chefbotd.storage import NotRegular, open_regular, read_file

Arrays = Mapping[str, NDArray[Any]]
SLAM = "made by SLAM"
NO_PILLOW = (
    f"Pillow, which reads images, is not installed on the robot's computer: {how_to_add_extra('maps')}"
)
LARGEST_YAML_BYTES, LARGEST_IMAGE_BYTES = 1 << 20, 1 << 30


def extent_of(grid: OccupancyGrid) -> Extent:
    """What the manifest says of a grid."""
    origin, (rows, columns) = grid.map_from_grid, grid.percent.shape
    return Extent(
        resolution_m=grid.resolution_m,
        columns=columns,
        rows=rows,
        x_m=origin.x_m,
        y_m=origin.y_m,
        heading_rad=origin.heading_rad,
    )


def contents_of(grid: OccupancyGrid, slam: Arrays | None = None) -> dict[str, Content]:
    """The files of a version; ``slam`` is what ``mapping.saved`` makes of a state."""
    contents: dict[str, Content] = {
        DESCRIPTION: to_description(grid, IMAGE).encode(),
        IMAGE: to_image(grid),
        CELLS: zlib.compress(np.ascontiguousarray(grid.percent).tobytes(), 6),
    }
    if slam is not None:
        arrays: Any = dict(slam)

        def write(file: BinaryIO) -> None:
            np.savez(file, **arrays)

        contents[GRAPH] = write
    return contents


def save(store: MapStore, name: str, grid: OccupancyGrid, slam: Arrays | None = None) -> int:
    """Save a map; the number of its version. Raises ``MapStoreError``; what was saved before is as it was then."""
    return store.save(name, contents_of(grid, slam), extent_of(grid), SLAM).manifest.version


def autosave(store: MapStore, grid: OccupancyGrid, slam: Arrays) -> None:
    """Save a map that is being made, in its own slot."""
    store.autosave(contents_of(grid, slam), extent_of(grid), SLAM)


def read_grid(store: MapStore, name: str) -> OccupancyGrid:
    """The cells of a map; raises ``MapStoreError``."""
    manifest, cells = store.read_file(name, CELLS)
    return grid_of(cells, manifest.extent)


def grid_of(cells: bytes, extent: Extent) -> OccupancyGrid:
    """A grid of compressed cells.

    Raises:
        MapStoreError: they are not what the extent says.
    """
    expected = extent.rows * extent.columns
    try:
        unpacker = zlib.decompressobj()
        data = unpacker.decompress(cells, expected + 1)
        if len(data) != expected:
            raise ValueError(f"{extent.rows} rows of {extent.columns} cells are expected")
        percent = np.frombuffer(data, np.int8).reshape(extent.rows, extent.columns)
        return OccupancyGrid(extent.resolution_m, extent.map_from_grid, percent)
    except (zlib.error, ValueError) as error:
        raise MapStoreError(
            RefusalKind.MAP_UNREADABLE,
            Sentence("maps.cells_unreadable", "the cells cannot be read: {why}", why=error),
        ) from error


def read_slam(store: MapStore, name: str) -> dict[str, NDArray[Any]] | None:
    """SLAM's state as it was saved with a map; None where the map was not made by SLAM. Raises ``MapStoreError``."""
    version, _ = store.read(name)
    return read_arrays(version.folder / GRAPH) if version.manifest.can_go_on else None


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a file; raises ``MapStoreError``."""
    try:
        with open_regular(path) as opened, np.load(opened, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zlib.error) as error:
        raise MapStoreError(
            RefusalKind.MAP_UNREADABLE,
            Sentence("maps.file_unreadable", "{file}: cannot be read: {why}", file=path, why=error),
        ) from error


class ReadMap(Record, frozen=True):
    """A map of map_server's files; ``notes`` say, for people, what of it they might not expect."""

    grid: OccupancyGrid
    notes: tuple[str, ...] = ()


def read_map_server(path: Path) -> ReadMap:
    """The map of a YAML file of map_server's and of the image that it names.

    Raises:
        MapStoreError: one of them cannot be read, or is not what it should be, or Pillow is not installed.
    """
    try:
        description = parse_description(_content(path, LARGEST_YAML_BYTES), path.name)
        grid = parse_image(_content(path.parent / description.image, LARGEST_IMAGE_BYTES), description)
        return ReadMap(grid, (*description.notes, *_grey_note(description, grid)))
    except OSError as error:
        where = error.filename or path
        raise MapStoreError(
            RefusalKind.MAP_UNREADABLE,
            Sentence(
                "maps.place_unreadable", "{file}: cannot be read: {why}", file=where, why=error.strerror
            ),
        ) from error
    except MapFileError as error:
        raise MapStoreError(RefusalKind.MAP_UNREADABLE, str(error)) from error
    except ModuleNotFoundError as error:
        if error.name != "PIL":
            raise
        raise MapStoreError(
            RefusalKind.MAP_UNREADABLE,
            Sentence("maps.no_pillow", "{file}: {why}", file=path.name, why=NO_PILLOW),
        ) from error


def _grey_note(description: MapDescription, grid: OccupancyGrid) -> tuple[str, ...]:
    """Whether what map_saver wrote for unknown was probably read as free: so map_server does it, too."""
    is_likely = description.mode is ImageMode.TRINARY and not description.negate
    if not is_likely or description.free_thresh <= 1 - GREY / 255 or (grid.percent == UNKNOWN).any():
        return ()
    return (
        f"no cell is unknown: with a threshold of {description.free_thresh:g} for free cells the grey {GREY}, which "
        f"ROS's map saver writes for unknown, is free; with {FREE_THRESH:g} it stays unknown",
    )


def _content(path: Path, most: int) -> bytes:
    """The bytes of a regular file; a FIFO or a device might never end."""
    try:
        return read_file(path, most)
    except NotRegular as error:
        raise MapFileError(f"{path.name}: expected a regular file") from error
    except OSError as error:
        if error.errno != errno.EFBIG:
            raise
        raise MapFileError(f"{path.name}: larger than the {most >> 20} MiB that are read") from error
