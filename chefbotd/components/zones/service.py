"""Zones in the daemon: read and changed one change at a time, and used by navigation at once."""

import asyncio
from collections.abc import Callable, Sequence

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.maps.drawn_file import DrawnFile, make_id
from chefbotd.components.maps.models import OfMapParams
from chefbotd.components.maps.outlines import why_no_area
from chefbotd.components.maps.service import MapsService
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.maps.storage.store import revision_of
from chefbotd.components.zones.events import ZonesChanged
from chefbotd.components.zones.models import (
    TOPICS,
    AddZonesParams,
    ChangeZonesParams,
    SaveZoneParams,
    ZoneId,
    ZoneList,
    ZoneShape,
    ZonesSaved,
    zone_data,
)
from chefbotd.components.zones.zone_file import (
    LARGEST_BYTES,
    NO_ZONES,
    ZONES,
    ZONES_BEFORE,
    Zones,
    parse_zones,
    with_zones,
    without_zone,
    write_zones,
)
from chefbotd.core.commands import RefusalKind
from chefbotd.core.sentence import Sentence
from chefbotd.features.feature import Feature
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.parameters import Role


class ZonesService:
    """The zones of stored maps, in a ``file`` beside each."""

    def __init__(self, bus: Bus, clock: Clock, maps: MapsService) -> None:
        self._maps = maps
        self.file = DrawnFile(bus, clock, maps, ZONES, "zones", ZonesChanged, ZONES_BEFORE)
        self._parsing, self._parsed = asyncio.Lock(), (b"", NO_ZONES)

    @method(role=Role.OBSERVE, for_guests=True)
    async def list_zones(self, caller: Caller, params: OfMapParams, progress: ProgressReporter) -> ZoneList:
        """The zones of a map: where navigation must not go, and where it goes slowly."""
        name = self._maps.named(params.map)
        content = await self.file.read(name)
        before = await self._maps.read_beside(name, ZONES_BEFORE)
        zones = await self._parse(content, name)
        rows = tuple(zone_data(own, zone) for own, zone in zones.named())
        return ZoneList(
            map=name, revision=revision_of(content), zones=rows, can_undo=before not in (None, content)
        )

    @method(role=Role.DRIVE, moves=False)
    async def save_zone(
        self, caller: Caller, params: SaveZoneParams, progress: ProgressReporter
    ) -> ZonesSaved:
        """Draw a zone on a map, or change the zone of this id; paths are planned again at once."""
        own = params.id or ""

        def changed(zones: Zones, revision: str) -> Zones:
            nonlocal own
            if params.kind != "wall" and (reason := why_no_area(params.outline_m)):
                raise MapStoreError(
                    RefusalKind.OUT_OF_RANGE, Sentence("zones.no_zone", "this is no zone: {why}", why=reason)
                )
            ids = {name for name, _ in zones.named()}
            if params.id is not None:
                _require_known(params.id, ids)
            own = params.id or make_id(revision, params.model_dump_json())
            return _checked(lambda: with_zones(zones, {own: params.zone(own)}))

        asked = params.enabled and not params.confirmed
        saved = await self.file.in_order(lambda: self._apply(params, changed, asks=asked))
        return ZonesSaved(
            map=saved.map,
            revision=saved.revision,
            zone=zone_data(own, params.zone(own)),
            warning=saved.warning,
        )

    @method(role=Role.DRIVE, moves=False)
    async def add_zones(
        self, caller: Caller, params: AddZonesParams, progress: ProgressReporter
    ) -> ZonesSaved:
        """Draw several new zones on a map, all or none of them; one ``undo_zones`` takes them back."""

        def changed(zones: Zones, revision: str) -> Zones:
            _require_areas(params.zones)
            shapes = enumerate(params.zones)
            ids = [make_id(revision, str(number), shape.model_dump_json()) for number, shape in shapes]
            drawn = {own: shape.zone(own) for own, shape in zip(ids, params.zones, strict=True)}
            return _checked(lambda: with_zones(zones, drawn))

        return await self.file.in_order(
            lambda: self._apply(params, changed, asks=not params.confirmed, continued=params.continued)
        )

    @method(role=Role.DRIVE, moves=False)
    async def delete_zone(self, caller: Caller, params: ZoneId, progress: ProgressReporter) -> ZonesSaved:
        """Take a zone off a map."""

        def changed(zones: Zones, _: str) -> Zones:
            _require_known(params.id, {name for name, _ in zones.named()})
            return without_zone(zones, params.id)

        return await self.file.in_order(lambda: self._apply(params, changed))

    @method(role=Role.DRIVE, moves=False)
    async def undo_zones(
        self, caller: Caller, params: ChangeZonesParams, progress: ProgressReporter
    ) -> ZonesSaved:
        """Take the last change of a map's zones back, to the byte; done again, it is made again."""
        return await self.file.in_order(lambda: self._undo(params))

    async def _undo(self, params: ChangeZonesParams) -> ZonesSaved:
        name, content = await self.file.read_for_change(params.map, params.revision)
        before = await self._maps.read_beside(name, ZONES_BEFORE)
        if before in (None, content):  # the latter where a change was cut off, or changed nothing
            raise MapStoreError(
                RefusalKind.NOTHING_TO_UNDO,
                Sentence(
                    "zones.nothing_to_undo",
                    "no change of the zones of the map {map!r} is remembered",
                    map=name,
                ),
            )
        return await self._save(name, content, before)

    async def _apply(
        self,
        params: ChangeZonesParams | ZoneId,
        change: Callable[[Zones, str], Zones],
        *,
        asks: bool = False,
        continued: bool = False,
    ) -> ZonesSaved:
        """Make a change; with ``asks`` only one that does nothing that may not be meant."""
        name, content = await self.file.read_for_change(params.map, params.revision)
        before = await self._parse(content, name)
        zones, new = await self.file.compute_in_thread(lambda: _change_zones(before, content, change))
        if asks:
            await self.file.require_meant(name, new)
        saved = await self._save(name, content, new, keeps_before=not continued)
        self._parsed = (new, zones)
        return saved

    async def _parse(self, content: bytes | None, name: str) -> Zones:
        """What is in the file; the last one that was read is remembered, so that many who look cost one reading."""
        async with self._parsing:
            text = content or b""
            if text != self._parsed[0]:
                self._parsed = (text, await self.file.compute_in_thread(lambda: _parse_content(text, name)))
            return self._parsed[1]

    async def _save(
        self, name: str, content: bytes | None, new: bytes, *, keeps_before: bool = True
    ) -> ZonesSaved:
        revision, warning = await self.file.save_change(name, content, new, keeps_before=keeps_before)
        return ZonesSaved(map=name, revision=revision, warning=warning)


def _change_zones(
    zones: Zones, content: bytes | None, change: Callable[[Zones, str], Zones]
) -> tuple[Zones, bytes]:
    """The zones after a change of this content, and their file, which may be too long."""
    changed = change(zones, revision_of(content))
    new = write_zones(changed)
    if len(new) > max(LARGEST_BYTES, len(content or b"")):
        raise MapStoreError(
            RefusalKind.OUT_OF_RANGE,
            Sentence(
                "zones.too_long",
                "the zones of the map have too many corners: delete some of them, or draw them with fewer",
            ),
        )
    return changed, new


def _parse_content(content: bytes, name: str) -> Zones:
    try:
        return parse_zones(content.decode(), ZONES)
    except ValueError as error:
        raise MapStoreError(
            RefusalKind.MAP_UNREADABLE,
            Sentence(
                "zones.unreadable", "the zones of the map {map!r} cannot be read: {why}", map=name, why=error
            ),
        ) from error


def _checked(make: Callable[[], Zones]) -> Zones:
    """Zones that may be too many."""
    try:
        return make()
    except ValueError as error:
        raise MapStoreError(
            RefusalKind.OUT_OF_RANGE,
            Sentence("zones.refused", "the zones cannot be changed so: {why}", why=error),
        ) from error


def _require_areas(shapes: Sequence[ZoneShape]) -> None:
    """Raises ``MapStoreError`` for the first that is no area."""
    for number, shape in enumerate(shapes):
        if shape.kind != "wall" and (reason := why_no_area(shape.outline_m)):
            raise MapStoreError(
                RefusalKind.OUT_OF_RANGE,
                Sentence(
                    "zones.no_zone_number", "number {number} is no zone: {why}", number=number + 1, why=reason
                ),
            )


def _require_known(own: str, ids: set[str]) -> None:
    if own not in ids:
        listed = ", ".join(sorted(ids)) or "none"
        raise MapStoreError(
            RefusalKind.UNKNOWN_ZONE,
            Sentence(
                "zones.unknown", "no zone with the id {zone!r}; there are: {listed}", zone=own, listed=listed
            ),
        )


def zones(service: ZonesService) -> Feature:
    """The zones of stored maps."""
    return Feature("zones", topics=TOPICS, methods=methods_of(service), offers=service)
