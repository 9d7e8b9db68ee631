"""Maps for viewers: assembled and packed in the writing thread, because a large one takes long."""

from collections.abc import Callable
from typing import Any

import msgspec

from chefbotd.core.geometry import Pose2D
from chefbotd.recording import foxglove as fg
from chefbotd.recording import foxglove_messages as fm
from chefbotd.recording.channels import Channels
from chefbotd.recording.chunk import ChunkBuilder

Cells = tuple[float, Pose2D, int, bytes]
"""Resolution in metres, ``map_from_grid``, columns, and a signed byte for each cell."""

ReadMap = Callable[[Any], Cells | None]


class MapDrawer:
    """Keeps the map that is in use or being made. ``read_map`` gives the cells of a stored one by its ``MapLoaded``."""

    def __init__(self, channels: Channels, read_map: ReadMap) -> None:
        self._channels, self._read_map = channels, read_map
        self._growing = fg.GrowingGrid()
        self._payload: bytes | None = None
        self.drawn_ns = 0

    def draw(self, event: Any, log_ns: int, sequence: int, sink: ChunkBuilder) -> None:
        """Draw the map after this event of it; one that cannot be read is not drawn."""
        if type(event).__name__ == "MapLoaded":
            found = self._read_map(event)
        else:
            cells = self._growing.apply(event)
            shape = event.resolution_m, event.map_from_grid, event.columns
            found = None if cells is None else (*shape, cells)
        if found is not None:
            self._payload = msgspec.json.encode(fg.grid(log_ns, *found))
            self.tell(log_ns, sequence, sink)

    def tell(self, log_ns: int, sequence: int, sink: ChunkBuilder) -> None:
        """Write the map as it is, if there is one."""
        if self._payload is not None:
            self.drawn_ns = log_ns
            channel = self._channels.number("/map", "foxglove.Grid", fm.SCHEMAS[fm.Grid])
            sink.add(channel, sequence, log_ns, self._payload)
