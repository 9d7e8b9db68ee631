"""The cells of a map in parts, as ``get_map`` sends them: a long answer would hold up the event loop and the client."""

import base64
from dataclasses import dataclass

from chefbotd.core.commands import RefusalKind
from chefbotd.features.maps.methods import MapPart
from chefbotd.maps.errors import MapStoreError
from chefbotd.maps.manifest import CELLS, Manifest
from chefbotd.maps.store import MapStore

PART_BYTES = 49_152
"""64 KiB as base64; a multiple of three, so that the texts of all parts are one base64."""


@dataclass(frozen=True, slots=True)
class _Cells:
    name: str
    manifest: Manifest
    data: bytes


class Cache:
    """The cells that were sent last, so that not every part is read and checked again."""

    def __init__(self) -> None:
        self._latest: _Cells | None = None

    def part(self, store: MapStore, name: str, part: int, now_s: float) -> MapPart:
        """A part of the latest version; raises ``MapStoreError``."""
        cells = self._cells(store, name)
        parts = max(1, -(-len(cells.data) // PART_BYTES))
        if part >= parts:
            raise MapStoreError(
                RefusalKind.OUT_OF_RANGE, f"the map {name!a} has {parts} parts, counted from 0, got {part}"
            )
        extent = cells.manifest.extent
        chosen = cells.data[part * PART_BYTES : (part + 1) * PART_BYTES]
        return MapPart(
            name=name,
            version=cells.manifest.version,
            stamp_s=now_s,
            saved_at_s=cells.manifest.saved_at_s,
            **extent.model_dump(),
            part=part,
            parts=parts,
            data=base64.b64encode(chosen).decode(),
        )

    def _cells(self, store: MapStore, name: str) -> _Cells:
        latest, stored = self._latest, store.describe(name)
        if latest is not None and (latest.name, latest.manifest) == (name, stored.manifest):
            return latest
        if stored.plain:
            raise MapStoreError(
                RefusalKind.MAP_UNREADABLE, f"the map {name!a} was put there by somebody else: load it first"
            )
        manifest, data = store.read_file(name, CELLS)
        self._latest = _Cells(name, manifest, data)
        return self._latest
