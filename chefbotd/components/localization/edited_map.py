"""A stored map with the edits that are drawn on it, as the worker uses it."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.map_edits.algorithms.drawing import draw_edits
from chefbotd.components.map_edits.edit_file import EDITS, parse_edits
from chefbotd.components.maps.storage.contents import extent_of
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.record import Record, replace

ReadEdits: TypeAlias = Callable[[str], bytes | None]
"""The content of the file of a map's edits; None where there is none. Raises ``Refused``."""


class EditedMap(Record, frozen=True):
    """A ``stored`` map, and what the ``content`` of the file of its edits makes of it.

    ``grid`` is without what was erased, the stored one itself where nothing was: localization finds its way by it.
    ``closed`` (rows, columns) is true in drawn walls and outside of what the map was cropped to: nobody drives there.
    """

    stored: OccupancyGrid
    content: bytes | None
    grid: OccupancyGrid
    closed: NDArray[np.bool_] | None = None


def edited_map(stored: OccupancyGrid, content: bytes | None) -> EditedMap:
    """A map with its edits.

    Raises:
        ValueError: the edits cannot be read.
    """
    edits = [edit for _, edit in parse_edits(content).edits()]
    if not edits:
        return EditedMap(stored, content, stored)
    cells, shape = np.ascontiguousarray(stored.percent).tobytes(), stored.percent.shape
    drawn = draw_edits(cells, extent_of(stored), edits)
    grid = stored
    if drawn.erased != cells:
        grid = replace(stored, percent=np.frombuffer(bytes(drawn.erased), np.int8).reshape(shape))
    closed = np.frombuffer(drawn.closed, np.uint8).reshape(shape) != 0
    return EditedMap(stored, content, grid, closed if closed.any() else None)


def stored_edits(folder: Path) -> ReadEdits:
    """Those of the store in this folder."""
    store = MapStore(folder, 1)
    return lambda name: store.read_beside(name, EDITS)
