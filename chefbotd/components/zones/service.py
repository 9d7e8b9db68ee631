"""Zones in the daemon: read and changed one change at a time, and used by navigation at once."""

import asyncio
import hashlib
from collections.abc import Awaitable, Callable, Mapping, Sequence

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.maps.drawn_file import DrawnFile, Use
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
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.sentence import Sentence, join_sentences
from chefbotd.features.feature import Feature
from chefbotd.inputs import inputs_of
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.parameters import Role

Places = Mapping[str, tuple[float, float]]


class ZonesService:
    """The zones of stored maps.

    ``examine`` says what a file of zones would do to the robot, to the places of the map in use and to the way there;
    ``use`` has navigation read them again, and says why it cannot. Navigation sets both, where there is one.
    """

    def __init__(self, bus: Bus, clock: Clock, maps: MapsService) -> None:
        self._bus, self._clock, self._maps = bus, clock, maps
        self._entries = inputs_of(clock)
        self._file = DrawnFile(clock, maps, ZONES, "zones", ZONES_BEFORE)
        self._parsing, self._parsed = asyncio.Lock(), (b"", NO_ZONES)
        self.examine: Callable[[bytes, Places], Awaitable[tuple[str, ...]]] | None = None
        self.use: Use | None = None

    @method(role=Role.OBSERVE, for_guests=True)
    async def list_zones(self, caller: Caller, params: OfMapParams, progress: ProgressReporter) -> ZoneList:
        """The zones of a map: where navigation must not go, and where it goes slowly."""
        name = self._maps.named(params.map)
        content = await self._file.read(name)
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
            own = params.id or _new_id(revision, params)
            return _checked(lambda: with_zones(zones, {own: params.zone(own)}))

        asked = params.enabled and not params.confirmed
        saved = await self._file.in_order(lambda: self._apply(params, changed, asks=asked))
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
            ids = [_new_id(f"{revision} {number}", shape) for number, shape in enumerate(params.zones)]
            drawn = {own: shape.zone(own) for own, shape in zip(ids, params.zones, strict=True)}
            return _checked(lambda: with_zones(zones, drawn))

        return await self._file.in_order(
            lambda: self._apply(params, changed, asks=not params.confirmed, continued=params.continued)
        )

    @method(role=Role.DRIVE, moves=False)
    async def delete_zone(self, caller: Caller, params: ZoneId, progress: ProgressReporter) -> ZonesSaved:
        """Take a zone off a map."""

        def changed(zones: Zones, _: str) -> Zones:
            _require_known(params.id, {name for name, _ in zones.named()})
            return without_zone(zones, params.id)

        return await self._file.in_order(lambda: self._apply(params, changed))

    @method(role=Role.DRIVE, moves=False)
    async def undo_zones(
        self, caller: Caller, params: ChangeZonesParams, progress: ProgressReporter
    ) -> ZonesSaved:
        """Take the last change of a map's zones back, to the byte; done again, it is made again."""
        return await self._file.in_order(lambda: self._undo(params))

    async def _undo(self, params: ChangeZonesParams) -> ZonesSaved:
        name = self._maps.named(params.map)
        content = await self._file.read(name)
        self._file.require_revision(content, params.revision)
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
        return await self._replace(name, content, before)

    async def _apply(
        self,
        params: ChangeZonesParams | ZoneId,
        change: Callable[[Zones, str], Zones],
        *,
        asks: bool = False,
        continued: bool = False,
    ) -> ZonesSaved:
        """Make a change; with ``asks`` only one that does nothing that may not be meant."""
        name = self._maps.named(params.map)
        content = await self._file.read(name)
        self._file.require_revision(content, params.revision)
        before = await self._parse(content, name)
        zones, new = await self._file.compute_in_thread(lambda: _change_zones(before, content, change))
        if asks and self.examine is not None and name == self._maps.in_use:
            listed = await self._maps.places(name)
            places = {place.name: (place.x_m, place.y_m) for place in listed.places}
            if concerns := await self.examine(new, places):
                raise Refused(RefusalKind.NEEDS_CONFIRMATION, join_sentences(concerns))
        saved = await self._replace(name, content, new, keeps_before=not continued)
        self._parsed = (new, zones)
        return saved

    async def _parse(self, content: bytes | None, name: str) -> Zones:
        """What is in the file; the last one that was read is remembered, so that many who look cost one reading."""
        async with self._parsing:
            text = content or b""
            if text != self._parsed[0]:
                self._parsed = (text, await self._file.compute_in_thread(lambda: _parse_content(text, name)))
            return self._parsed[1]

    async def _replace(
        self, name: str, content: bytes | None, new: bytes, *, keeps_before: bool = True
    ) -> ZonesSaved:
        """Replace what was there, and have navigation use it."""
        await self._file.replace(name, content, new, keeps_before=keeps_before)
        revision = revision_of(new)
        self._entries.observe(self._bus, ZonesChanged(self._clock.now_s(), name, revision))
        warning = await self._file.why_unused(name, self.use)
        return ZonesSaved(map=name, revision=revision, warning=warning or None)


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


def _new_id(revision: str, params: ZoneShape) -> str:
    """An id that no other zone has had, the same whenever the same is done again."""
    drawn = f"{revision} {params.model_dump_json()}"
    return hashlib.sha256(drawn.encode()).hexdigest()[:8]


def zones(service: ZonesService) -> Feature:
    """The zones of stored maps."""
    return Feature("zones", topics=TOPICS, methods=methods_of(service), offers=service)
