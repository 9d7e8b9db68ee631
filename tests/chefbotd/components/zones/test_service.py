"""Changes of zones whose client goes, or meets an edit by hand, over maps in memory."""

import asyncio
import math
import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.maps.models import OfMapParams
from chefbotd.components.maps.service import MapsService
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.zones import service as service_module
from chefbotd.components.zones.models import (
    MOST_POINTS,
    AddZonesParams,
    ChangeZonesParams,
    SaveZoneParams,
    ZoneId,
    ZoneShape,
)
from chefbotd.components.zones.service import ZonesService
from chefbotd.components.zones.zone_file import (
    LARGEST_BYTES,
    ZONES,
    ZONES_BEFORE,
    Zones,
    parse_zones,
    write_zones,
)
from chefbotd.core.commands import RefusalKind

PARAMS = SaveZoneParams(points_m=[[1.0, 2.0], [3.0, 2.0], [3.0, 2.8]])


class MapsInMemory:
    """One map in use, whose files take a moment to read and to write."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.in_use = "flat"

    def named(self, name: str | None) -> str:
        return name or self.in_use

    async def read_beside(self, of_map: str, file: str) -> bytes | None:
        await asyncio.sleep(0)
        return self.files.get(file)

    async def change_beside(self, of_map: str, file: str, change: Callable[[bytes | None], bytes]) -> None:
        await asyncio.sleep(0)
        self.files[file] = change(self.files.get(file))
        await asyncio.sleep(0)

    async def places(self, name: str) -> Any:
        return SimpleNamespace(places=())


def service(maps: MapsInMemory) -> ZonesService:
    """It needs a running loop."""
    return ZonesService(Bus(), LoopClock(), cast(MapsService, maps))


@pytest.mark.parametrize("steps", range(16))
def test_zones_on_the_disk_are_driven_by_also_where_the_client_goes(steps: int) -> None:
    """Its request is cancelled after any number of steps: nothing was written, or navigation has read what was."""

    async def scenario() -> None:
        maps, used = MapsInMemory(), []
        zones = service(maps)

        async def use() -> str:
            await asyncio.sleep(0)
            used.append(maps.files.get(ZONES))
            return ""

        zones.file.use = use
        asking = asyncio.ensure_future(zones.save_zone(cast(Any, None), PARAMS, cast(Any, None)))
        for _ in range(steps):
            await asyncio.sleep(0)
        asking.cancel()
        await asyncio.wait([asking])
        written = maps.files.get(ZONES)
        assert used == ([] if written is None else [written])

    run_virtual(scenario())


def test_an_edit_by_hand_while_navigation_is_asked_is_kept_and_so_is_what_undo_brings_back() -> None:
    """The request is refused; the file is as edited, and the one before it as it was."""

    async def scenario() -> None:
        maps = MapsInMemory()
        maps.files = {ZONES: b"keep_out: []\n", ZONES_BEFORE: b"# older\n"}
        zones = service(maps)

        async def examine(*_: object) -> tuple[str, ...]:
            maps.files[ZONES] = b"# by hand\n"
            return ()

        zones.file.examine = examine
        with pytest.raises(MapStoreError) as refused:
            await zones.save_zone(cast(Any, None), PARAMS, cast(Any, None))
        assert refused.value.kind is RefusalKind.CHANGED_MEANWHILE
        assert maps.files == {ZONES: b"# by hand\n", ZONES_BEFORE: b"# older\n"}

    run_virtual(scenario())


def test_many_zones_are_read_and_written_beside_the_loop_and_read_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """YAML of some thousand corners takes a second, in which a stop would wait: it is read in another thread."""
    loop_thread = threading.get_ident()
    threads: list[int] = []

    def parse(text: str, name: str) -> Zones:
        threads.append(threading.get_ident())
        return parse_zones(text, name)

    def write(zones: Zones) -> bytes:
        threads.append(threading.get_ident())
        return write_zones(zones)

    monkeypatch.setattr(service_module, "parse_zones", parse)
    monkeypatch.setattr(service_module, "write_zones", write)

    async def scenario() -> None:
        maps = MapsInMemory()
        maps.files = {ZONES: b"keep_out: [{corners_m: [[0, 0], [1, 0], [1, 1]]}]\n"}
        zones = service(maps)
        asked = [zones.list_zones(cast(Any, None), OfMapParams(), cast(Any, None)) for _ in range(20)]
        assert {len(listed.zones) for listed in await asyncio.gather(*asked)} == {1}
        assert len(threads) == 1
        await zones.save_zone(cast(Any, None), PARAMS, cast(Any, None))
        listed = await zones.list_zones(cast(Any, None), OfMapParams(), cast(Any, None))
        assert len(listed.zones) == 2
        maps.files[ZONES] = b"# by hand\n"
        assert (await zones.list_zones(cast(Any, None), OfMapParams(), cast(Any, None))).zones == ()
        assert len(threads) == 3
        assert loop_thread not in threads

    asyncio.run(scenario())


def test_zones_are_not_made_longer_than_can_be_read_again() -> None:
    """What would not be read any more is refused, and all that was drawn can still be listed and deleted."""

    async def scenario() -> None:
        maps = MapsInMemory()
        zones = service(maps)
        circle = [
            [round(math.cos(0.0314 * k), 6), round(math.sin(0.0314 * k), 6)] for k in range(MOST_POINTS)
        ]
        shape = ZoneShape(points_m=circle)
        many = AddZonesParams(zones=[shape] * 12)

        async def draw_on() -> None:
            for _ in range(20):
                await zones.add_zones(cast(Any, None), many, cast(Any, None))

        with pytest.raises(MapStoreError, match="too many corners") as refused:
            await draw_on()
        assert refused.value.kind is RefusalKind.OUT_OF_RANGE
        assert len(maps.files[ZONES]) <= LARGEST_BYTES
        listed = await zones.list_zones(cast(Any, None), OfMapParams(), cast(Any, None))
        await zones.delete_zone(cast(Any, None), ZoneId(id=listed.zones[0].id), cast(Any, None))
        after = await zones.list_zones(cast(Any, None), OfMapParams(), cast(Any, None))
        assert len(after.zones) == len(listed.zones) - 1

    run_virtual(scenario())


def test_a_change_that_the_disk_did_not_take_is_none_that_could_be_undone() -> None:
    """The disk is full when the zones are written, and their state before it has been: undo would do nothing."""

    class FullMaps(MapsInMemory):
        async def change_beside(
            self, of_map: str, file: str, change: Callable[[bytes | None], bytes]
        ) -> None:
            if file == ZONES:
                raise MapStoreError(RefusalKind.STORAGE_FAILED, "no space left on the device")
            await super().change_beside(of_map, file, change)

    async def scenario() -> None:
        maps = FullMaps()
        maps.files = {ZONES: b"keep_out: []\n"}
        zones = service(maps)
        with pytest.raises(MapStoreError, match="no space left"):
            await zones.save_zone(cast(Any, None), PARAMS, cast(Any, None))
        assert not (await zones.list_zones(cast(Any, None), OfMapParams(), cast(Any, None))).can_undo
        with pytest.raises(MapStoreError) as refused:
            await zones.undo_zones(cast(Any, None), ChangeZonesParams(), cast(Any, None))
        assert refused.value.kind is RefusalKind.NOTHING_TO_UNDO

    run_virtual(scenario())


def test_a_zone_that_is_saved_as_it_was_leaves_the_last_change_to_be_undone() -> None:
    """Nothing was changed by it, so what undo brings back is what was before the last change."""

    async def scenario() -> None:
        maps = MapsInMemory()
        zones = service(maps)
        saved = await zones.save_zone(cast(Any, None), PARAMS, cast(Any, None))
        assert saved.zone is not None
        again = PARAMS.model_copy(update={"id": saved.zone.id})
        assert (await zones.save_zone(cast(Any, None), again, cast(Any, None))).revision == saved.revision
        await zones.undo_zones(cast(Any, None), ChangeZonesParams(), cast(Any, None))
        assert (await zones.list_zones(cast(Any, None), OfMapParams(), cast(Any, None))).zones == ()

    run_virtual(scenario())
