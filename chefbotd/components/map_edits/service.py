"""The edits of stored maps in the daemon: one change at a time, each shown and driven by at once."""

import zlib
from collections.abc import Callable
from typing import Final

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.map_edits.algorithms.drawing import draw_edits
from chefbotd.components.map_edits.edit_file import (
    EDITS,
    MapEdits,
    parse_edits,
    step_back,
    step_forward,
    with_edit,
    with_view_angle,
    without_edit,
    write_edits,
)
from chefbotd.components.map_edits.events import MapEdited
from chefbotd.components.map_edits.models import (
    TOPICS,
    ChangeEditsParams,
    EditMapParams,
    MapEditData,
    MapEditId,
    MapEditList,
    MapEditsSaved,
    TurnMapViewParams,
    edit_data,
)
from chefbotd.components.maps.drawn_file import DrawnFile, make_id
from chefbotd.components.maps.models import OfMapParams
from chefbotd.components.maps.outlines import why_no_area
from chefbotd.components.maps.parts import Redraw
from chefbotd.components.maps.service import MapsService
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.maps.storage.manifest import Extent
from chefbotd.components.maps.storage.store import revision_of
from chefbotd.core.commands import RefusalKind
from chefbotd.core.sentence import Sentence
from chefbotd.features.feature import Feature
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.parameters import Role

Change = Callable[[MapEdits], MapEdits]
COMPRESSION: Final = 6


class MapEditsService:
    """The edits of stored maps, in a ``file`` beside each."""

    def __init__(self, bus: Bus, clock: Clock, maps: MapsService) -> None:
        self._maps = maps
        self.file = DrawnFile(bus, clock, maps, EDITS, "edits", MapEdited)
        maps.redraw_with(Redraw(EDITS, redraw_cells))

    @method(role=Role.OBSERVE)
    async def list_map_edits(
        self, caller: Caller, params: OfMapParams, progress: ProgressReporter
    ) -> MapEditList:
        """The edits of a map: what was erased, which walls were drawn, and to what it was cropped."""
        name = self._maps.named(params.map)
        content = await self.file.read(name)
        edits = await self.file.compute_in_thread(lambda: _parsed(content, name))
        return MapEditList(
            map=name,
            revision=revision_of(content),
            edits=tuple(edit_data(own, edit) for own, edit in edits.edits()),
            view_angle_rad=edits.state.view_angle_rad,
            can_undo=edits.can_undo,
            can_redo=edits.can_redo,
        )

    @method(role=Role.DRIVE, moves=False)
    async def edit_map(
        self, caller: Caller, params: EditMapParams, progress: ProgressReporter
    ) -> MapEditsSaved:
        """Erase a part of a map, draw a wall, or crop the map; paths are planned again at once."""
        saved: MapEditData | None = None

        def changed(edits: MapEdits) -> MapEdits:
            nonlocal saved
            if params.kind != "wall" and (reason := why_no_area(params.outline_m)):
                raise MapStoreError(
                    RefusalKind.OUT_OF_RANGE,
                    Sentence("map_edits.no_area", "this is no area: {why}", why=reason),
                )
            own, edit = make_id(write_edits(edits).decode(), params.model_dump_json()), params.edit()
            saved = edit_data(own, edit)
            return with_edit(edits, own, edit)

        made = await self.file.in_order(lambda: self._apply(params, changed))
        return MapEditsSaved(map=made.map, revision=made.revision, edit=saved, warning=made.warning)

    @method(role=Role.DRIVE, moves=False)
    async def turn_map_view(
        self, caller: Caller, params: TurnMapViewParams, progress: ProgressReporter
    ) -> MapEditsSaved:
        """Turn the view of a map; its frame, its places, its zones and all that is driven by stay as they are."""
        return await self.file.in_order(
            lambda: self._change_edits(params, lambda edits: with_view_angle(edits, params.angle_rad))
        )

    @method(role=Role.DRIVE, moves=False)
    async def delete_map_edit(
        self, caller: Caller, params: MapEditId, progress: ProgressReporter
    ) -> MapEditsSaved:
        """Take an edit off a map, whatever was drawn after it."""

        def changed(edits: MapEdits) -> MapEdits:
            ids = edits.state.edits
            if params.id not in ids:
                listed = ", ".join(ids) or "none"
                raise MapStoreError(
                    RefusalKind.UNKNOWN_EDIT,
                    Sentence(
                        "map_edits.unknown",
                        "no edit with the id {edit!r}; there are: {listed}",
                        edit=params.id,
                        listed=listed,
                    ),
                )
            return without_edit(edits, params.id)

        return await self.file.in_order(lambda: self._apply(params, changed))

    @method(role=Role.DRIVE, moves=False)
    async def undo_map_edit(
        self, caller: Caller, params: ChangeEditsParams, progress: ProgressReporter
    ) -> MapEditsSaved:
        """Take the last change of a map's edits back, and then those before it; the map is as before, to the byte."""

        def changed(edits: MapEdits) -> MapEdits:
            if not edits.can_undo:
                raise MapStoreError(
                    RefusalKind.NOTHING_TO_UNDO,
                    Sentence("map_edits.nothing_to_undo", "no change of the map's edits is remembered"),
                )
            return step_back(edits)

        return await self.file.in_order(lambda: self._apply(params, changed))

    @method(role=Role.DRIVE, moves=False)
    async def redo_map_edit(
        self, caller: Caller, params: ChangeEditsParams, progress: ProgressReporter
    ) -> MapEditsSaved:
        """Make the change of a map's edits again that was taken back last."""

        def changed(edits: MapEdits) -> MapEdits:
            if not edits.can_redo:
                raise MapStoreError(
                    RefusalKind.NOTHING_TO_UNDO,
                    Sentence("map_edits.nothing_to_redo", "no change of the map's edits was taken back last"),
                )
            return step_forward(edits)

        return await self.file.in_order(lambda: self._apply(params, changed))

    async def _apply(self, params: ChangeEditsParams, change: Change) -> MapEditsSaved:
        """Make a change; one that is not confirmed, only if it does nothing that may not be meant."""
        return await self._change_edits(params, change, asks=not params.confirmed)

    async def _change_edits(
        self, params: ChangeEditsParams | TurnMapViewParams, change: Change, *, asks: bool = False
    ) -> MapEditsSaved:
        name, content = await self.file.read_for_change(params.map, params.revision)
        new, is_redrawn = await self.file.compute_in_thread(lambda: _change_content(content, name, change))
        if asks and is_redrawn:
            await self.file.require_meant(name, new)
        revision, warning = await self.file.save_change(name, content, new, is_visible=is_redrawn)
        return MapEditsSaved(map=name, revision=revision, warning=warning)


def redraw_cells(cells: bytes, extent: Extent, content: bytes) -> bytes:
    """Compressed cells of a map of this extent as people see it with these edits, compressed.

    Raises:
        ValueError: the edits or the cells cannot be read.
    """
    edits = [edit for _, edit in parse_edits(content).edits()]
    if not edits:
        return cells
    try:
        plain = zlib.decompressobj().decompress(cells, extent.rows * extent.columns + 1)
    except zlib.error as error:
        raise ValueError(f"its cells cannot be read: {error}") from error
    if len(plain) != extent.rows * extent.columns:
        raise ValueError(f"{extent.rows} rows of {extent.columns} cells are expected")
    return zlib.compress(draw_edits(plain, extent, edits).shown(), COMPRESSION)


def _change_content(content: bytes | None, name: str, change: Change) -> tuple[bytes, bool]:
    """The file after a change, and whether the map looks different with it."""
    before = _parsed(content, name)
    try:
        edits = change(before)
    except ValueError as error:
        raise MapStoreError(
            RefusalKind.OUT_OF_RANGE,
            Sentence("map_edits.refused", "the map cannot be edited so: {why}", why=error),
        ) from error
    return write_edits(edits), edits.edits() != before.edits()


def _parsed(content: bytes | None, name: str) -> MapEdits:
    try:
        return parse_edits(content)
    except ValueError as error:
        raise MapStoreError(
            RefusalKind.MAP_UNREADABLE,
            Sentence(
                "map_edits.unreadable",
                "the edits of the map {map!r} cannot be read: {why}",
                map=name,
                why=error,
            ),
        ) from error


def map_edits(service: MapEditsService) -> Feature:
    """The edits of stored maps."""
    return Feature("map_edits", topics=TOPICS, methods=methods_of(service), offers=service)
