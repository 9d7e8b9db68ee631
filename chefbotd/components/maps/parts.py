"""Sends the cells of ``get_map`` in parts, because a long answer would delay the event loop and the client."""

import base64
from collections.abc import Callable

from chefbotd.components.maps.events import MapChanged
from chefbotd.components.maps.models import MapPart
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.maps.storage.manifest import CELLS, Extent, Manifest
from chefbotd.components.maps.storage.store import MapStore, revision_of
from chefbotd.core.commands import RefusalKind
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence

PART_BYTES = 49_152
"""64 KiB as base64; a multiple of three, so that the texts of all parts are one base64."""

MOST_CLIENTS = 8
"""For so many at once a map that is being made is kept; who comes later replaces who began first."""


class Cells(Record, frozen=True):
    """Compressed cells; ``saved_at_s`` is None for a map that is being made, whose version is its revision."""

    name: str | None
    version: int
    saved_at_s: float | None
    extent: Extent
    data: bytes
    edits: str | None = None

    def part(self, part: int, now_s: float) -> MapPart:
        """A part of them; raises ``MapStoreError``."""
        parts = max(1, -(-len(self.data) // PART_BYTES))
        if part >= parts:
            raise MapStoreError(
                RefusalKind.OUT_OF_RANGE,
                Sentence(
                    "maps.parts",
                    "the map has {parts} parts, counted from 0, got {part}",
                    parts=parts,
                    part=part,
                ),
            )
        chosen = self.data[part * PART_BYTES : (part + 1) * PART_BYTES]
        return MapPart(
            name=self.name,
            version=self.version,
            stamp_s=now_s,
            saved_at_s=self.saved_at_s,
            **self.extent.model_dump(),
            part=part,
            parts=parts,
            edits=self.edits,
            data=base64.b64encode(chosen).decode(),
        )


class Redraw(Record, frozen=True):
    """How maps are redrawn before they are sent: ``draw`` by the content of ``file``, which lies beside each map.

    It takes and returns compressed cells, and raises ``ValueError`` for a content that cannot be read.
    """

    file: str
    draw: Callable[[bytes, Extent, bytes], bytes]


class Cache:
    """The cells that were sent last, so that not every part is read and checked again."""

    def __init__(self) -> None:
        self._latest: tuple[str, Manifest, Cells] | None = None
        self._growing: dict[int, Cells] = {}  # by the number of the session that fetches it, the latest last
        self.redraw: Redraw | None = None

    def part(self, store: MapStore, name: str, part: int, now_s: float) -> MapPart:
        """A part of the latest version of a stored map; raises ``MapStoreError``. It waits for the disk."""
        return self._cells(store, name).part(part, now_s)

    def keep(self, session: int, name: str | None, grown: MapChanged) -> None:
        """Send this session this of the map that is being made, until the next one is kept for it."""
        origin = grown.map_from_grid
        extent = Extent(
            resolution_m=grown.resolution_m,
            columns=grown.columns,
            rows=grown.rows,
            x_m=origin.x_m,
            y_m=origin.y_m,
            heading_rad=origin.heading_rad,
        )
        self._growing.pop(session, None)
        self._growing[session] = Cells(name, grown.revision, None, extent, grown.cells)
        while len(self._growing) > MOST_CLIENTS:
            del self._growing[next(iter(self._growing))]

    def growing_part(self, session: int, part: int, now_s: float) -> MapPart:
        """A part of what was kept for this session; raises ``MapStoreError``."""
        if session not in self._growing:
            raise MapStoreError(
                RefusalKind.OUT_OF_RANGE,
                Sentence("maps.first_part", "of a map that is being made, ask for part 0 first"),
            )
        return self._growing[session].part(part, now_s)

    def _cells(self, store: MapStore, name: str) -> Cells:
        stored, redraw = store.describe(name), self.redraw
        content = None if redraw is None else store.read_beside(name, redraw.file)
        edits = None if content is None else revision_of(content)
        if self._latest is not None:
            latest_name, manifest, cells = self._latest
            if (latest_name, manifest, cells.edits) == (name, stored.manifest, edits):
                return cells
        if stored.plain:
            raise MapStoreError(
                RefusalKind.MAP_UNREADABLE,
                Sentence(
                    "maps.foreign", "the map {map!r} was not saved by chefbotd: load it first", map=name
                ),
            )
        manifest, data = store.read_file(name, CELLS)
        if redraw is not None and content is not None:
            data = _redrawn(redraw, data, manifest.extent, content, name)
        cells = Cells(name, manifest.version, manifest.saved_at_s, manifest.extent, data, edits)
        self._latest = (name, manifest, cells)
        return cells


def _redrawn(redraw: Redraw, data: bytes, extent: Extent, content: bytes, name: str) -> bytes:
    try:
        return redraw.draw(data, extent, content)
    except ValueError as error:
        raise MapStoreError(
            RefusalKind.MAP_UNREADABLE,
            Sentence("maps.cannot_show", "the map {map!r} cannot be shown: {why}", map=name, why=error),
        ) from error
