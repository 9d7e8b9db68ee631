"""Changes of zones whose client goes, or meets an edit by hand, over maps in memory."""

import asyncio
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.maps.service import MapsService
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.zones.models import SaveZoneParams
from chefbotd.components.zones.service import ZonesService
from chefbotd.components.zones.zone_file import ZONES, ZONES_BEFORE
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

        zones.use = use
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

        zones.examine = examine
        with pytest.raises(MapStoreError) as refused:
            await zones.save_zone(cast(Any, None), PARAMS, cast(Any, None))
        assert refused.value.kind is RefusalKind.CHANGED_MEANWHILE
        assert maps.files == {ZONES: b"# by hand\n", ZONES_BEFORE: b"# older\n"}

    run_virtual(scenario())
