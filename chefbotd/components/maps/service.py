"""The stored maps, in the daemon: the map in use, and every change in order, none of it in the event loop's time."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import structlog
from msgspec.structs import replace

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.maps import parts
from chefbotd.components.maps.events import MapChanged, MapLoaded, MapUnloaded
from chefbotd.components.maps.importer import Report, repeat_report, run_import
from chefbotd.components.maps.models import (
    GetMapParams,
    ImportMapParams,
    LoadMapParams,
    MapInUse,
    MapList,
    MapName,
    MapPart,
    MapSummary,
    OfMapParams,
    PlaceData,
    PlaceList,
    PlaceName,
    RenameMapParams,
    SavePlaceParams,
)
from chefbotd.components.maps.robot_pose import RobotPose
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.maps.storage.importing import Order
from chefbotd.components.maps.storage.killers import KILLED, killed_to_file, why_it_ended
from chefbotd.components.maps.storage.limits import why_doubtful, why_too_large
from chefbotd.components.maps.storage.manifest import Manifest
from chefbotd.components.maps.storage.names import map_name, place_name
from chefbotd.components.maps.storage.places import (
    PLACES,
    Place,
    parse_places,
    to_file,
    with_place,
    without_place,
)
from chefbotd.components.maps.storage.store import MapStore, StoredMap
from chefbotd.components.maps.storage.versions import Version
from chefbotd.components.worker.watch import WorkerState, took_too_much, was_too_slow
from chefbotd.core.commands import RefusalKind
from chefbotd.core.events.robot import WorkerReported
from chefbotd.core.geometry import wrap_angle
from chefbotd.core.sentence import Sentence, join_sentences
from chefbotd.features.feature import Feature, Service
from chefbotd.inputs import inputs_of
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import DONE, Done, NoParams
from chefbotd.rpc.parameters import Role

log = structlog.get_logger(component="maps")

MOST_THREADS = 4


class MapsService:
    """The maps of a store; ``in_use`` is the name of the map in use.

    ``growing`` gives the map that is being made, where one can be. ``made_ready`` waits until the way can be found on
    the map in use, and says why it cannot. ``most_memory_mb`` is what the worker may take, where there is one: a map
    that needs more is not taken into use. What waits for the disk runs in threads of its own.
    """

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        store: MapStore,
        versions_kept: int,
        most_memory_mb: float | None = None,
    ) -> None:
        self._most_memory_mb = most_memory_mb
        self._bus, self._clock, self.store, self._kept = bus, clock, store, versions_kept
        self._entries = inputs_of(clock)
        self._robot_pose = RobotPose(bus)
        self.growing: Callable[[], Awaitable[MapChanged]] | None = None
        self.made_ready: Callable[[Report], Awaitable[str]] | None = None
        self._threads = ThreadPoolExecutor(MOST_THREADS, "maps")
        self._order = asyncio.Lock()
        self._cells = parts.Cache()
        self.in_use: str | None = None
        self._version_in_use: int | None = None
        self._is_made_ready = False
        self._worker_ended, self._end_reason = asyncio.Event(), ""
        bus.add_handler(self._take_worker, WorkerReported)

    async def run(self) -> None:
        """Use the map that was in use before; then there is nothing to do until a client asks."""
        try:
            await self._load_last()
        except MapStoreError as problem:
            log.warning("cannot load the map that was last in use", error=str(problem))
        while True:
            await self._worker_ended.wait()
            self._worker_ended.clear()
            await self._stop_using(self._end_reason)

    def _take_worker(self, event: WorkerReported) -> None:
        """A worker that ended while it made the map ready, or of its memory, would end so again.

        One that was too slow to answer may only have had a busy computer.
        """
        if event.state != WorkerState.RESTARTING or self.in_use is None:
            return
        ended_of_it = self._is_made_ready and not was_too_slow(event.reason)
        if ended_of_it or took_too_much(event.reason):
            self._end_reason = event.reason
            self._worker_ended.set()

    async def _stop_using(self, reason: str) -> None:
        """Remember that the map in use ended the worker, and use none."""
        async with self._order:
            name, version = self.in_use, self._version_in_use
            if name is None or version is None:
                return
            try:
                await self._changing(
                    self.store.change_beside, name, KILLED, lambda _: killed_to_file(version, reason)
                )
            except MapStoreError as problem:
                log.error("cannot remember that a map ended the worker", map=name, error=str(problem))
            why = Sentence(
                "maps.ended_worker",
                "the map {map} is not used any more, as it ended the worker: {why}",
                map=name,
                why=reason,
            )
            log.error("a map ended the worker", map=name, reason=reason)
            self.in_use = None
            self._entries.observe(self._bus, MapUnloaded(self._clock.now_s(), name, why))

    async def _why_not_again(self, name: str, version: int) -> str:
        content = await self._in_thread(self.store.read_beside, name, KILLED)
        return why_it_ended(content, version)

    async def _load_last(self) -> None:
        name = await self._in_thread(self.store.current)
        if name is not None and self.in_use is None:
            async with self._order:
                await self._changing(self.store.repair)
                renamed = await self._in_thread(
                    self.store.current
                )  # a renaming that was cut off is finished by now
                name = renamed or name
                version, _ = await self._in_thread(self.store.read, name)
                if why := await self._why_not_again(name, version.manifest.version):
                    log.error(
                        "the map is not loaded by itself; load_map tries it again", map=name, reason=why
                    )
                    reason = Sentence(
                        "maps.not_loaded",
                        "the map {map} is not loaded by itself, because its {why}",
                        map=name,
                        why=why,
                    )
                    self._entries.observe(self._bus, MapUnloaded(self._clock.now_s(), name, reason))
                    return
                await self._use(name)

    # what clients ask: each runs as a job, because the disk may take its time

    @method(role=Role.OBSERVE, for_guests=True)
    async def list_maps(self, caller: Caller, params: NoParams, progress: ProgressReporter) -> MapList:
        """List the stored maps, whether each is intact, and which one is in use."""
        in_use = self.in_use  # of one moment: another may be loaded while the disk is read

        def read() -> list[Any]:
            return [self._summarize(name, in_use) for name in self.store.names()]

        maps = await self._in_thread(read)
        return MapList(folder=str(self.store.folder), in_use=in_use, maps=tuple(maps))

    def _summarize(self, name: str, in_use: str | None) -> MapSummary:
        summary = _summary(self.store.describe(name, thorough=True), in_use)
        if summary.version is None:
            return summary
        why = why_it_ended(self.store.read_beside(name, KILLED), summary.version)
        return replace(summary, problem="; ".join(filter(None, (summary.problem, why))) or None)

    @method(role=Role.DRIVE, moves=False)
    async def load_map(self, caller: Caller, params: LoadMapParams, progress: ProgressReporter) -> MapInUse:
        """Use a map from now on, and after a restart."""
        name = map_name(params.name)
        return await self._entries.outside(
            lambda: self._loaded(name, progress.report, params.resolution_is_right)
        )

    async def _loaded(self, name: str, report: Report, resolution_is_right: bool) -> MapInUse:
        """Wait until localization can use it; files that were edited by hand are imported first."""
        with repeat_report(report, "waiting for the disk") as tell:
            async with self._order:
                ignored = await self._import_edited(name, tell)
                used = await self._use(name, resolution_is_right=resolution_is_right)
                before = await self._why_not_again(name, used.version)
            problem = "" if self.made_ready is None else await self._make_ready(self.made_ready, tell)
        warning = join_sentences((ignored or "", used.warning or "", before or "", problem)) or None
        return replace(used, warning=warning)

    async def _make_ready(self, made_ready: Callable[[Report], Awaitable[str]], tell: Report) -> str:
        self._is_made_ready = True
        try:
            return await made_ready(tell)
        finally:
            self._is_made_ready = False

    async def _import_edited(self, name: str, report: Report) -> str | None:
        """Import files that were put there or edited; why not, if they are no map and a saved version is whole."""
        if not await self._in_thread(self.store.needs_import, name):
            return None
        try:
            yaml = self.store.folder / f"{name}.yaml"
            _, notes = await self._import(yaml, name, "edited files", report, keeps_graph=True)
        except MapStoreError as problem:
            if (await self._in_thread(self.store.describe, name)).manifest is None:
                raise
            return f"{name}.yaml and its image are not a valid map, so the saved version is used: {problem}"
        return notes or None

    async def use_saved(self, name: str) -> None:
        """Use a map that was made just now."""
        async with self._order:
            await self._use(map_name(name))

    async def _use(self, name: str, *, resolution_is_right: bool = True) -> MapInUse:
        version, damage = await self._in_thread(self.store.read, name)
        self._require_usable(name, version, resolution_is_right=resolution_is_right)
        await self._changing(self.store.set_current, name)
        self.in_use, self._version_in_use = name, version.manifest.version
        self._announce(name, version)
        warning = join_sentences(_damage_words(damage)) or None
        return MapInUse(name=name, version=version.manifest.version, warning=warning)

    def _require_usable(self, name: str, version: Version, *, resolution_is_right: bool) -> None:
        """Refuse a map before it is in use: a worker that takes too much memory is killed, again and again."""
        extent, doubt, most_mb = version.manifest.extent, "", self._most_memory_mb
        if not resolution_is_right and (doubt := why_doubtful(extent)):
            doubt += ": is that meant? Correct the YAML file and import it again, or say as you load it that it is right"
        too_large = "" if most_mb is None else why_too_large(extent, most_mb)
        if reason := join_sentences((doubt, too_large)):
            raise MapStoreError(
                RefusalKind.OUT_OF_RANGE,
                Sentence("maps.not_used", "the map {map!r} is not used: {why}", map=name, why=reason),
            )

    def _announce(self, name: str, version: Version, renamed_from: str | None = None) -> None:
        folder, number = str(self.store.folder), version.manifest.version
        log.info("map in use", map=name, version=number)
        self._entries.observe(self._bus, MapLoaded(self._clock.now_s(), folder, name, number, renamed_from))

    @method(role=Role.OBSERVE, for_guests=True)
    async def get_map(self, caller: Caller, params: GetMapParams, progress: ProgressReporter) -> MapPart:
        """The cells of a map, compressed, in parts."""
        name, part, now_s = params.name, params.part, self._clock.now_s()
        if name is None and self.growing is not None and self._robot_pose.is_mapping:
            if part == 0:
                self._cells.keep(caller.session.number, self._robot_pose.mapped, await self.growing())
            return self._cells.growing_part(caller.session.number, part, now_s)
        name = self.named(name)
        cells: MapPart = await self._in_thread(self._cells.part, self.store, name, part, now_s)
        return cells

    @method(role=Role.ADMIN, moves=False)
    async def import_map(
        self, caller: Caller, params: ImportMapParams, progress: ProgressReporter
    ) -> MapInUse:
        """Store the map of map_server's files on the robot's computer."""
        path = self.store.folder / params.yaml
        name = map_name(path.stem if params.name is None else params.name)
        async with self._order:
            names = await self._in_thread(self.store.names)
            if name in names and not params.replace:
                raise MapStoreError(
                    RefusalKind.MAP_EXISTS,
                    Sentence(
                        "maps.exists_replace",
                        "there is a map {map!r} already; replace makes this its next version",
                        map=name,
                    ),
                )
            version, notes = await self._import(path, name, str(path), progress.report)
            return MapInUse(name=name, version=version, warning=notes or None)

    async def _import(
        self, yaml: Path, name: str, source: str, report: Report, *, keeps_graph: bool = False
    ) -> tuple[int, str]:
        order = Order(
            folder=self.store.folder,
            versions_kept=self._kept,
            name=name,
            yaml=yaml,
            source=source,
            keeps_graph=keeps_graph,
        )
        return await run_import(order, report)

    @method(role=Role.ADMIN, moves=False)
    async def rename_map(self, caller: Caller, params: RenameMapParams, progress: ProgressReporter) -> Done:
        """Give a map another name."""
        name, new_name = params.name, params.new_name
        async with self._order:
            self._require_not_mapped(name)
            await self._changing(self.store.rename, name, new_name)
            if self.in_use == map_name(name):
                self.in_use = map_name(new_name)
                version, _ = await self._in_thread(self.store.read, self.in_use)
                self._announce(self.in_use, version, renamed_from=map_name(name))
        return DONE

    @method(role=Role.ADMIN, moves=False)
    async def copy_map(self, caller: Caller, params: RenameMapParams, progress: ProgressReporter) -> MapInUse:
        """Keep a copy of a map to go back to, with its places, its zones and its edits; the map in use stays so."""
        async with self._order:
            await self._changing(self.store.copy, params.name, params.new_name)
            version, _ = await self._in_thread(self.store.read, params.new_name)
        return MapInUse(name=map_name(params.new_name), version=version.manifest.version)

    @method(role=Role.ADMIN, moves=False)
    async def delete_map(self, caller: Caller, params: MapName, progress: ProgressReporter) -> Done:
        """Remove a map with all its versions and places."""
        name = params.name
        async with self._order:
            self._require_not_mapped(name)
            await self._changing(self.store.delete, name)
            if self.in_use == map_name(name):
                self._entries.observe(self._bus, MapUnloaded(self._clock.now_s(), self.in_use))
                self.in_use = None
        return DONE

    @method(role=Role.DRIVE, moves=False)
    async def save_place(
        self, caller: Caller, params: SavePlaceParams, progress: ProgressReporter
    ) -> PlaceData:
        """Give a pose in a map a name, or move the place of this name; without a pose, the robot's."""
        of_map = self.named(params.map)
        pose = self._pose(params, of_map)
        name, given = place_name(params.name), params.model_dump(include={"kind", "note"}, exclude_none=True)
        saved = Place(**pose)

        def changed(places: dict[str, Place]) -> dict[str, Place]:
            nonlocal saved
            before = places.get(name)
            kept = {} if before is None else before.model_dump(include={"kind", "note"})
            saved = Place(**pose, **{**kept, **given})
            return with_place(places, name, saved)

        await self._change_places(of_map, changed)
        return PlaceData(name=name, **saved.model_dump())

    def _pose(self, params: SavePlaceParams, of_map: str) -> dict[str, float]:
        if params.x_m is not None and params.y_m is not None:
            heading_rad = wrap_angle(params.heading_rad or 0.0)
            return {"x_m": params.x_m, "y_m": params.y_m, "heading_rad": heading_rad}
        pose = self._robot_pose.pose_in(of_map, self.in_use, self._clock.now_s())
        return {"x_m": pose.x_m, "y_m": pose.y_m, "heading_rad": pose.heading_rad}

    @method(role=Role.OBSERVE, for_guests=True)
    async def list_places(self, caller: Caller, params: OfMapParams, progress: ProgressReporter) -> PlaceList:
        """The places of a map."""
        return await self.places(params.map)

    async def places(self, of_map: str | None) -> PlaceList:
        """The places of a map."""
        name = self.named(of_map)
        places = parse_places(await self.read_beside(name, PLACES), name)
        rows = tuple(PlaceData(name=place_name, **place.model_dump()) for place_name, place in places.items())
        return PlaceList(map=name, places=rows)

    @method(role=Role.DRIVE, moves=False)
    async def delete_place(self, caller: Caller, params: PlaceName, progress: ProgressReporter) -> Done:
        """Remove a place."""
        await self._change_places(self.named(params.map), lambda places: without_place(places, params.name))
        return DONE

    async def _change_places(
        self, of_map: str, change: Callable[[dict[str, Place]], dict[str, Place]]
    ) -> None:
        def rewritten(data: bytes | None) -> bytes:
            return to_file(change(parse_places(data, of_map)))

        await self.change_beside(of_map, PLACES, rewritten)

    # what is kept beside a map

    async def read_beside(self, of_map: str, file: str) -> bytes | None:
        """A file that belongs to all versions of a map; None where there is none. Raises ``MapStoreError``."""
        content: bytes | None = await self._in_thread(self.store.read_beside, of_map, file)
        return content

    def redraw_with(self, redraw: parts.Redraw) -> None:
        """Send maps as this redraws them."""
        self._cells.redraw = redraw

    async def change_beside(self, of_map: str, file: str, change: Callable[[bytes | None], bytes]) -> None:
        """Replace such a file by what ``change`` makes of it, which may raise ``MapStoreError`` and leave it."""
        async with self._order:
            await self._changing(self.store.change_beside, of_map, file, change)

    # inside

    def _require_not_mapped(self, name: str) -> None:
        """What is being added to a map belongs to its name."""
        if self._robot_pose.is_mapping and self._robot_pose.mapped == map_name(name):
            raise MapStoreError(
                RefusalKind.ALREADY_MAPPING,
                Sentence(
                    "maps.being_extended",
                    "the map {map!r} is being extended: finish or discard that first",
                    map=name,
                ),
            )

    def named(self, name: str | None) -> str:
        """The map of this name, or else the one in use."""
        if name is not None:
            return map_name(name)
        if self.in_use is None:
            raise MapStoreError(
                RefusalKind.NO_MAP_LOADED,
                Sentence("maps.none_in_use", "no map is in use: load one, or name one"),
            )
        return self.in_use

    async def _in_thread(self, function: Callable[..., Any], *arguments: object) -> Any:
        run = asyncio.get_running_loop().run_in_executor
        return await self._entries.outside(lambda: run(self._threads, partial(function, *arguments)))

    async def _changing(self, change: Callable[..., object], *arguments: object) -> None:
        """Change the store. It is not given up half-way: the next change waits, also where this one is cancelled."""
        work = asyncio.ensure_future(self._in_thread(change, *arguments))
        try:
            await asyncio.shield(work)
        except asyncio.CancelledError:
            await asyncio.wait([work])
            raise


def _summary(stored: StoredMap, in_use: str | None) -> MapSummary:
    """A map as it is sent."""
    damage = (stored.damage or {}).items()
    row = MapSummary(
        name=stored.name,
        condition="foreign" if stored.plain else "damaged",
        problem="; ".join(f"version {number}: {why}" for number, why in damage) or None,
        in_use=stored.name == in_use,
        version=None,
        versions=stored.versions,
        saved_at_s=None,
        source=None,
        resolution_m=None,
        columns=None,
        rows=None,
        size_bytes=None,
        can_go_on=False,
    )
    return row if stored.manifest is None else _with_manifest(row, stored.manifest)


def _with_manifest(row: MapSummary, manifest: Manifest) -> MapSummary:
    return replace(
        row,
        condition="whole",
        version=manifest.version,
        saved_at_s=manifest.saved_at_s,
        source=manifest.source,
        resolution_m=manifest.extent.resolution_m,
        columns=manifest.extent.columns,
        rows=manifest.extent.rows,
        size_bytes=manifest.total_bytes,
        can_go_on=manifest.can_go_on,
    )


def maps(service: MapsService) -> Feature:
    """Stored maps and their places, over the service that keeps them."""
    return Feature(
        "maps", services=(Service("maps", service.run),), methods=methods_of(service), offers=service
    )


def _damage_words(damage: Mapping[int, str]) -> list[str]:
    return [
        Sentence("maps.version_because", "version {number}: {why}", number=number, why=why)
        for number, why in damage.items()
    ]
