"""The socket's methods for maps, in a daemon with a folder of maps, called by the client that users have."""

import asyncio
import base64
import contextlib
import json
import math
import os
import zlib
from collections.abc import Awaitable, Callable
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from chefbotd.bus import Bus
from chefbotd.client import CallError, Client
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.maps import importer, parts
from chefbotd.components.maps.algorithms.map_server import to_description, to_image
from chefbotd.components.maps.events import MapChanged, MapLoaded, MappingChanged, MapUnloaded
from chefbotd.components.maps.models import (
    GetMapParams,
    LoadMapParams,
    MapName,
    RenameMapParams,
    SavePlaceParams,
)
from chefbotd.components.maps.service import MapsService
from chefbotd.components.maps.storage.contents import read_slam, save
from chefbotd.components.maps.storage.disk import MapStoreError, lock_folder
from chefbotd.components.maps.storage.importing import Order
from chefbotd.components.maps.storage.killers import KILLED, why_it_ended
from chefbotd.components.maps.storage.parameters import MapsParameters
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.core.events.robot import MapPoseUpdated, WorkerReported
from chefbotd.core.geometry import CERTAIN, Pose2D
from chefbotd.core.occupancy_grid import FREE, UNKNOWN, OccupancyGrid
from chefbotd.rpc.models import NoParams
from chefbotd.settings import load
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice
from tests.budget import sample
from tests.chefbotd.components.maps.storage.test_store import grid, same
from tests.waiting import PATIENCE_S, until

Scenario = Callable[[Client], Awaitable[None]]
NOBODY: Any = SimpleNamespace(session=SimpleNamespace(number=1))
ANOTHER: Any = SimpleNamespace(session=SimpleNamespace(number=2))
NOT_TOLD: Any = SimpleNamespace(report=lambda done, total, text: None)


def with_daemon(folder: Path, scenario: Scenario) -> None:
    """Run it against a daemon that keeps its maps in this folder, in real time: threads and processes take theirs."""
    settings = load().model_copy(update={"maps": MapsParameters(folder=folder)})

    async def run() -> None:
        async with running_daemon(FakeSerialDevice(), settings) as client:
            await scenario(client)

    asyncio.run(run())


def write_files(folder: Path, name: str, of_grid: OccupancyGrid) -> Path:
    """map_server's files, as somebody brings them."""
    (folder / f"{name}.pgm").write_bytes(to_image(of_grid))
    path = folder / f"{name}.yaml"
    path.write_text(to_description(of_grid, f"{name}.pgm"), encoding="utf-8")
    return path


def test_an_import_whose_program_is_slow_to_start_says_that_it_is_at_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within 1.5 s, before its program has said a word: else a client gives the request up after 5 s."""
    assert importer.REPEAT_S <= 1.5
    slow, reported = tmp_path / "slow_python", tmp_path / "reported"
    slow.write_text(
        f"#!/bin/sh\nuntil [ -e '{reported}' ]; do sleep 0.1; done\necho '{{\"version\": 7}}'\n",
        encoding="utf-8",
    )
    slow.chmod(0o755)
    monkeypatch.setattr(importer.sys, "executable", str(slow))
    told: list[tuple[float, float, str]] = []

    def report(*words: Any) -> None:
        told.append(words)
        reported.touch()

    order = Order(folder=tmp_path, versions_kept=3, name="flat", yaml=tmp_path / "flat.yaml", source="a test")
    assert asyncio.run(importer.run_import(order, report)) == (7, "")
    assert told[0] == (0.0, 1.0, "starts the program that imports it")


def test_a_map_is_imported_loaded_and_sent(tmp_path: Path) -> None:
    """Every cell arrives, and the daemon knows after a restart which map was in use."""
    yaml = write_files(tmp_path, "flat", grid(1))
    reports: list[tuple[float, float, str]] = []

    async def first(client: Client) -> None:
        assert (await client.list_maps()).maps == ()
        imported = await client.import_map(str(yaml), on_progress=lambda *told: reports.append(told))
        assert (imported.name, imported.version) == ("flat", 1)
        loaded = await client.load_map("flat")
        assert (loaded.version, loaded.warning) == (1, None)
        image = await client.get_map()
        assert same(image.grid(), grid(1))

    async def second(client: Client) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while (
                listed := await client.list_maps()
            ).in_use is None:  # it is read beside, however long the disk takes
                pass
        assert listed.in_use == "flat"
        (only,) = listed.maps
        assert (only.name, only.condition, only.in_use, only.can_go_on) == ("flat", "whole", True, False)
        assert (only.columns, only.rows, only.source) == (11, 7, str(yaml))

    with_daemon(tmp_path / "maps", first)
    of_program = [
        told for told in reports if "starts" not in told[2]
    ]  # which a busy machine takes a while for
    assert of_program[0] == (0.0, 2.0, "reading")
    assert reports[-1] == (2.0, 2.0, "saved")
    with_daemon(tmp_path / "maps", second)


def test_a_map_comes_in_parts_which_fit_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise is hard to compress: 300 by 200 percentages in parts of 3000 bytes."""
    monkeypatch.setattr(parts, "PART_BYTES", 3000)
    percent = np.random.default_rng(3).integers(-1, 101, (200, 300)).astype(np.int8)
    noise = OccupancyGrid(0.05, Pose2D(1.0, -2.0, 0.5), percent)
    save(MapStore(tmp_path), "noise", noise)
    counted: list[tuple[float, float, str]] = []

    async def scenario(client: Client) -> None:
        image = await client.get_map("noise", on_progress=lambda *told: counted.append(told))
        assert same(image.grid(), noise)
        last = counted[-1]
        assert (last[0], last[1] > 10) == (last[1], True)
        with pytest.raises(CallError, match=r"has \d+ parts, counted from 0, got 999") as refused:
            await client.call("get_map", name="noise", part=999)
        assert refused.value.kind == "out_of_range"

    with_daemon(tmp_path, scenario)


@pytest.mark.parametrize(
    ("files", "told"),
    sample([
        ({}, "x.yaml: cannot be read: No such file or directory"),
        ({"x.yaml": b"image: x.pgm\nresolution: -1\norigin: [0, 0, 0]\n"}, "greater than or equal to 0.001"),
        ({"x.yaml": b"image: x.pgm\nresolution: 1\norigin: [0, 0, 0]\n"}, "x.pgm: cannot be read: No such file"),
        ({"x.yaml": b"image: x.yaml\nresolution: 1\norigin: [0, 0, 0]\n"}, "x.yaml: cannot be read as an image"),
        ({"x.yaml": b"\xff\xfe\x00"}, "x.yaml: a map's YAML is keys and values, got str"),
        ({"x.yaml": b"[" * 100}, "x.yaml: not valid YAML"),
    ], fast=2),
)  # fmt: skip
def test_files_that_are_no_map_are_refused_with_what_is_wrong(
    tmp_path: Path, files: dict[str, bytes], told: str
) -> None:
    """The file is named, and nothing is stored."""
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)

    async def scenario(client: Client) -> None:
        with pytest.raises(CallError) as refused:
            await client.import_map(str(tmp_path / "x.yaml"), "flat")
        assert refused.value.kind == "map_unreadable"
        assert told in refused.value.message
        assert (await client.list_maps()).maps == ()

    with_daemon(tmp_path / "maps", scenario)


def test_gmappings_own_size_is_cropped_and_that_is_said(tmp_path: Path) -> None:
    """A flat of 9 by 6 m in 600 by 600 cells, with 1 m around: 220 by 160 cells, its corner shifted with them."""
    cells = np.full((600, 600), UNKNOWN, np.int8)
    cells[240:360, 210:390] = FREE
    yaml = write_files(tmp_path, "flat", OccupancyGrid(0.05, Pose2D(-15.0, -15.0, 0.0), cells))

    async def scenario(client: Client) -> None:
        imported = await client.import_map(str(yaml))
        assert imported.warning is not None
        assert "cropped: 30 by 30 m" in imported.warning
        assert "11 by 8 m in 220 by 160 cells" in imported.warning
        image = await client.get_map("flat")
        assert (image.columns, image.rows) == (220, 160)
        assert (image.x_m, image.y_m) == (pytest.approx(-5.5), pytest.approx(-4.0))

    with_daemon(tmp_path / "maps", scenario)


def test_a_resolution_that_can_hardly_be_meant_is_asked_about_before_the_map_is_in_use(
    tmp_path: Path,
) -> None:
    """Said when it is imported; refused when it is loaded, until somebody says that it is right."""
    yaml = write_files(tmp_path, "typo", OccupancyGrid(0.5, Pose2D(), np.zeros((20, 30), np.int8)))

    async def scenario(client: Client) -> None:
        imported = await client.import_map(str(yaml))
        assert "a resolution of 0.5 m makes it 15 by 10 m" in (imported.warning or "")
        with pytest.raises(CallError, match="is that meant") as refused:
            await client.load_map("typo")
        assert refused.value.kind == "out_of_range"
        assert (await client.list_maps()).in_use is None
        assert (await client.load_map("typo", resolution_is_right=True)).name == "typo"
        assert (await client.list_maps()).in_use == "typo"

    with_daemon(tmp_path / "maps", scenario)


def test_a_map_that_needs_too_much_memory_is_refused_and_the_one_in_use_stays(tmp_path: Path) -> None:
    """Of 150 MB and 80 bytes a cell none is left with 150 MB: by load_map, after mapping, and at the start."""
    for name in ("small", "large"):
        save(MapStore(tmp_path), name, grid(1))

    async def scenario() -> None:
        service = MapsService(Bus(), LoopClock(), MapStore(tmp_path), 3)
        await service.load_map(NOBODY, LoadMapParams(name="small"), NOT_TOLD)
        tight = MapsService(Bus(), LoopClock(), MapStore(tmp_path), 3, most_memory_mb=150.0)
        tight.in_use = "small"
        with pytest.raises(
            MapStoreError, match=r"'large' is not used.*about 150 MB.*the worker may take 150"
        ):
            await tight.load_map(NOBODY, LoadMapParams(name="large"), NOT_TOLD)
        with pytest.raises(MapStoreError, match="crop the map"):
            await tight.use_saved("large")
        assert tight.in_use == "small"
        assert MapStore(tmp_path).current() == "small"

    asyncio.run(scenario())


def test_a_map_that_ended_the_worker_is_not_used_again_by_itself(tmp_path: Path) -> None:
    """Killed for its memory: no map is in use, which is said; not at the next start either, but when it is asked for."""
    save(MapStore(tmp_path), "large", grid(1))
    reason = "it took 900 MB of memory; 800 MB are allowed"
    told: list[MapUnloaded] = []

    async def run(service: MapsService, steps: Callable[[], Awaitable[None]]) -> None:
        running = asyncio.create_task(service.run())
        try:
            await steps()
        finally:
            running.cancel()

    async def scenario() -> None:
        bus = Bus()
        bus.add_handler(told.append, MapUnloaded)
        service = MapsService(bus, LoopClock(), MapStore(tmp_path), 3)

        async def dies() -> None:
            await service.load_map(NOBODY, LoadMapParams(name="large"), NOT_TOLD)
            bus.publish(WorkerReported(state="restarting", reason="it was killed by SIGKILL", stamp_s=1.0))
            assert service.in_use == "large"  # another reason, which may have nothing to do with the map
            bus.publish(WorkerReported(state="restarting", reason=reason, stamp_s=2.0))
            await until(lambda: service.in_use is None)

        await run(service, dies)
        assert (told[0].name, reason in told[0].reason) == ("large", True)

        next_bus = Bus()
        next_bus.add_handler(told.append, MapUnloaded)
        again = MapsService(next_bus, LoopClock(), MapStore(tmp_path), 3)

        async def starts() -> None:
            await until(lambda: len(told) == 2)
            assert "the map large is not loaded by itself" in told[1].reason
            assert reason in told[1].reason
            listed = await again.list_maps(NOBODY, NoParams(), NOT_TOLD)
            assert (again.in_use, listed.in_use) == (None, None)
            assert reason in (listed.maps[0].problem or "")
            used = await again.load_map(NOBODY, LoadMapParams(name="large"), NOT_TOLD)
            assert (again.in_use, reason in (used.warning or "")) == ("large", True)

        await run(again, starts)
        assert not why_it_ended(MapStore(tmp_path).read_beside("large", KILLED), 2)  # another version may do

    asyncio.run(scenario())


def test_an_existing_map_is_not_imported_over_unless_that_is_said(tmp_path: Path) -> None:
    """Then it becomes the next version, and the places stay."""
    save(MapStore(tmp_path / "maps"), "flat", grid(1))
    yaml = write_files(tmp_path, "flat", grid(2))

    async def scenario(client: Client) -> None:
        await client.save_place("kitchen", 1.5, -2.25, 0.75, of_map="flat")
        with pytest.raises(CallError, match="there is a map 'flat' already") as refused:
            await client.import_map(str(yaml))
        assert refused.value.kind == "map_exists"
        assert same((await client.get_map("flat")).grid(), grid(1))
        assert (await client.import_map(str(yaml), replace=True)).version == 2
        assert same((await client.get_map("flat")).grid(), grid(2))
        assert len((await client.list_places("flat")).places) == 1

    with_daemon(tmp_path / "maps", scenario)


def test_files_put_into_the_folder_or_edited_there_are_read_when_they_are_loaded(tmp_path: Path) -> None:
    """Files of somebody else's first; then a change with an editor, which keeps what SLAM needs to go on."""
    write_files(tmp_path, "theirs", grid(1))
    store = MapStore(tmp_path)
    save(store, "ours", grid(1), {"seed": np.array(1)})

    async def scenario(client: Client) -> None:
        conditions = {each.name: each.condition for each in (await client.list_maps()).maps}
        assert conditions == {"ours": "whole", "theirs": "foreign"}
        with pytest.raises(CallError, match="was not saved by chefbotd: load it first"):
            await client.get_map("theirs")
        assert (await client.load_map("theirs")).version == 1
        assert same((await client.get_map()).grid(), grid(1))
        write_files(tmp_path, "ours", grid(2))
        assert (await client.load_map("ours")).version == 2
        assert same((await client.get_map()).grid(), grid(2))
        slam = read_slam(store, "ours")
        assert slam is not None
        assert int(slam["seed"]) == 1

    with_daemon(tmp_path, scenario)


def test_a_map_whose_public_files_are_spoilt_is_used_as_it_was_saved(tmp_path: Path) -> None:
    """An image that was cut off while it was copied: the saved version is used, and that is said."""
    save(MapStore(tmp_path), "flat", grid(1))
    (tmp_path / "flat.pgm").write_bytes(b"P5\n11 7\n255\n...")

    async def scenario(client: Client) -> None:
        loaded = await client.load_map("flat")
        assert loaded.version == 1
        assert loaded.warning is not None
        assert loaded.warning.startswith(
            "flat.yaml and its image are not a valid map, so the saved version is"
        )
        assert same((await client.get_map()).grid(), grid(1))

    with_daemon(tmp_path, scenario)


def test_places_belong_to_a_map_and_go_with_it(tmp_path: Path) -> None:
    """Saved, moved, listed in their order, renamed with their map, deleted; each wrong name names what there is."""
    save(MapStore(tmp_path), "flat", grid(1))

    async def scenario(client: Client) -> None:
        with pytest.raises(CallError, match="no map is in use") as refused:
            await client.save_place("kitchen", 1.0, 2.0)
        assert refused.value.kind == "no_map_loaded"
        await client.load_map("flat")
        with pytest.raises(CallError, match=r"wait until it is localized, .* or say where it is") as refused:
            await client.save_place("kitchen")
        assert refused.value.kind == "pose_unknown"
        await client.save_place("Küche #2", 1.5, -2.25, 0.75)
        await client.save_place("table 3", 3.0, 0.5, 2 * math.pi)
        await client.save_place("Ku\u0308che #2", 1.75, -2.0, -0.5)
        await client.rename_map("flat", "home")
        listed = await client.list_places()
        assert listed.map == "home"
        assert [(p.name, p.x_m, p.y_m, p.heading_rad) for p in listed.places] == [
            ("Küche #2", 1.75, -2.0, -0.5),
            ("table 3", 3.0, 0.5, 0.0),
        ]
        await client.delete_place("table 3")
        with pytest.raises(CallError, match="no place named 'table 3'; there are: Küche #2") as refused:
            await client.delete_place("table 3")
        assert refused.value.kind == "unknown_place"
        with pytest.raises(CallError, match="name: expected text without control characters"):
            await client.save_place("\n", 1.0, 1.0)

    with_daemon(tmp_path, scenario)


def test_a_place_has_a_kind_and_a_note_and_keeps_them_where_it_is_moved(tmp_path: Path) -> None:
    """Saved with the map; changed one by one; an old file has neither, and is other without a note."""
    save(MapStore(tmp_path), "flat", grid(1))
    path = tmp_path / "flat.map" / "places.json"
    old = {"format": 1, "places": {"door": {"x_m": 0.5, "y_m": 1.5, "heading_rad": 0.25}}}
    path.write_text(json.dumps(old))

    async def scenario(client: Client) -> None:
        await client.save_place("window", 1.0, 2.0, of_map="flat", kind="table", note="two chairs")
        moved = await client.save_place("window", 1.25, 2.0, of_map="flat")
        assert (moved.x_m, moved.kind, moved.note) == (1.25, "table", "two chairs")
        await client.save_place("window", 1.25, 2.0, of_map="flat", note="")
        listed = await client.list_places("flat")
        assert [(p.name, p.kind, p.note) for p in listed.places] == [
            ("door", "other", ""),
            ("window", "table", ""),
        ]
        with pytest.raises(CallError, match=r"kind: Input should be .*, got 'sofa'"):
            await client.call("save_place", name="x", x_m=0.0, y_m=0.0, map="flat", kind="sofa")
        with pytest.raises(CallError, match=r"note: .*at most 200 characters"):
            await client.save_place("x", 0.0, 0.0, of_map="flat", note="n" * 201)

    with_daemon(tmp_path, scenario)
    assert json.loads(path.read_text())["places"] == {
        "door": old["places"]["door"],
        "window": {"x_m": 1.25, "y_m": 2.0, "heading_rad": 0.0, "kind": "table"},
    }


def test_damaged_places_are_told_and_left_alone(tmp_path: Path) -> None:
    """Saving another one does not overwrite what a person may still repair."""
    save(MapStore(tmp_path), "flat", grid(1))
    path = tmp_path / "flat.map" / "places.json"
    path.write_bytes(b'{"format": 1, "places": {"kitchen": {"x_m": 1')

    async def scenario(client: Client) -> None:
        for request in (client.list_places("flat"), client.save_place("door", 1.0, 2.0, of_map="flat")):
            with pytest.raises(
                CallError, match=r"the places of the map 'flat' cannot be read: places\.json: "
            ) as told:
                await request
            assert told.value.kind == "map_unreadable"

    with_daemon(tmp_path, scenario)
    assert path.read_bytes().endswith(b'"x_m": 1')


def test_the_map_in_use_is_announced_renamed_and_given_up_when_it_is_deleted(tmp_path: Path) -> None:
    """Whoever localizes the robot hears of each of these."""
    save(MapStore(tmp_path), "flat", grid(1))

    async def run() -> None:
        bus = Bus()
        events = bus.subscribe(MapLoaded, MapUnloaded)
        service = MapsService(bus, LoopClock(), MapStore(tmp_path), 3)
        await service.load_map(NOBODY, LoadMapParams(name="flat"), NOT_TOLD)
        await service.rename_map(NOBODY, RenameMapParams(name="flat", new_name="home"), NOT_TOLD)
        await service.delete_map(NOBODY, MapName(name="home"), NOT_TOLD)
        assert service.in_use is None
        told = [await anext(aiter(events)) for _ in range(3)]
        assert [(type(event), event.name) for event in told] == [
            (MapLoaded, "flat"),
            (MapLoaded, "home"),
            (MapUnloaded, "home"),
        ]
        assert (told[0].folder, told[0].version) == (str(tmp_path), 1)

    asyncio.run(run())


def test_loading_waits_for_whoever_makes_the_map_ready_and_says_so_all_the_time(tmp_path: Path) -> None:
    """He takes 7 s for a large map, longer than a client waits for what is silent; what he cannot do is a warning."""
    save(MapStore(tmp_path), "flat", grid(1))
    told: list[tuple[float, str]] = []

    async def made_ready(report: Callable[[float, float, str], None]) -> str:
        report(1.0, 3.0, "finding its walls")
        await asyncio.sleep(7.0)
        return "nobody can find the way on it"

    async def run() -> None:
        service = MapsService(Bus(), LoopClock(), MapStore(tmp_path), 3)
        service.made_ready = made_ready
        now_s = asyncio.get_running_loop().time
        progress: Any = SimpleNamespace(report=lambda done, total, text: told.append((now_s(), text)))
        begun_s = now_s()
        used = await service.load_map(NOBODY, LoadMapParams(name="flat"), progress)
        assert used.warning == "nobody can find the way on it"
        times_s = [begun_s, *(at_s for at_s, _ in told), now_s()]
        assert max(after - before for before, after in pairwise(times_s)) < 1.5
        count = len(told)
        await asyncio.sleep(3.0)
        assert len(told) == count

    run_virtual(run())
    assert {text for _, text in told} == {"finding its walls"}


def test_a_map_that_mapping_goes_on_with_keeps_its_name_and_stays(tmp_path: Path) -> None:
    """Renaming and deleting it are refused until mapping ends; other maps are not concerned."""
    for name in ("flat", "cellar", "attic"):
        save(MapStore(tmp_path), name, grid(1))

    async def run() -> None:
        bus = Bus()
        service = MapsService(bus, LoopClock(), MapStore(tmp_path), 3)
        bus.publish(mapping_told("paused", "flat"))
        for change in (
            service.rename_map(NOBODY, RenameMapParams(name="flat", new_name="home"), NOT_TOLD),
            service.delete_map(NOBODY, MapName(name="flat"), NOT_TOLD),
        ):
            with pytest.raises(MapStoreError, match="the map 'flat' is being extended") as refused:
                await change
            assert refused.value.kind == "already_mapping"
        await service.rename_map(NOBODY, RenameMapParams(name="cellar", new_name="basement"), NOT_TOLD)
        await service.delete_map(NOBODY, MapName(name="attic"), NOT_TOLD)
        bus.publish(mapping_told("idle", None))
        await service.rename_map(NOBODY, RenameMapParams(name="flat", new_name="home"), NOT_TOLD)
        assert MapStore(tmp_path).names() == ["basement", "home"]

    asyncio.run(run())


def test_damage_that_changes_no_size_is_listed(tmp_path: Path) -> None:
    """One bit of the cells is another one: the newest version is told as damaged, and the map is the one before it."""
    store = MapStore(tmp_path)
    save(store, "flat", grid(1))
    save(store, "flat", grid(2))
    cells = tmp_path / "flat.map" / "v000002" / "cells.zlib"
    data = bytearray(cells.read_bytes())
    data[len(data) // 2] ^= 0x10
    cells.write_bytes(data)

    async def run() -> None:
        service = MapsService(Bus(), LoopClock(), store, 3)
        (only,) = (await service.list_maps(NOBODY, NoParams(), NOT_TOLD)).maps
        assert (only.condition, only.version) == ("whole", 1)
        assert only.problem == "version 2: cells.zlib is damaged: its checksum differs"

    asyncio.run(run())


def pose_told(stamp_s: float, state: str) -> MapPoseUpdated:
    """What mapping or localization tells."""
    return MapPoseUpdated(stamp_s, Pose2D(1.25, -0.5, 2.0), Pose2D(), CERTAIN, 0.97, state)


def mapping_told(state: str, name: str | None) -> MappingChanged:
    """How a map stands."""
    return MappingChanged(state, name, 7, 1, 5.5, 80, stamp_s=0.0)


@pytest.mark.parametrize(
    ("told", "age_s", "mapping", "why"),
    [
        ("localized", 0.5, None, None),
        ("localized", 0.5, ("idle", None), None),
        ("mapping", 0.5, ("mapping", "flat"), None),
        ("localized", 2.5, None, "nothing tells it at present"),
        (None, 0.0, None, "nothing tells it at present"),
        ("lost", 0.5, None, "it is lost"),
        ("uncertain", 0.5, ("mapping", "flat"), "it is uncertain"),
        ("mapping", 0.5, ("mapping", None), "another map is being made"),
        ("mapping", 0.5, ("paused", "cellar"), "another map is being made"),
    ],
)
def test_where_the_robot_stands_becomes_a_place_if_that_is_known(
    tmp_path: Path, told: str | None, age_s: float, mapping: tuple[str, str | None] | None, why: str | None
) -> None:
    """In the map that it is known for, by scans that fit, and now."""
    save(MapStore(tmp_path), "flat", grid(1))

    async def run() -> None:
        bus, clock = Bus(), LoopClock()
        service = MapsService(bus, clock, MapStore(tmp_path), 3)
        await service.load_map(NOBODY, LoadMapParams(name="flat"), NOT_TOLD)
        if told is not None:
            bus.publish(pose_told(clock.now_s() - age_s, told))
        if mapping is not None:
            bus.publish(mapping_told(*mapping))
        if why is None:
            place = await service.save_place(NOBODY, SavePlaceParams(name="here"), NOT_TOLD)
            assert (place.x_m, place.y_m, place.heading_rad) == (1.25, -0.5, 2.0)
        else:
            with pytest.raises(MapStoreError, match=f"in the map 'flat' is not known \\({why}\\)"):
                await service.save_place(NOBODY, SavePlaceParams(name="here"), NOT_TOLD)

    asyncio.run(run())


def test_the_map_that_is_being_made_is_sent_where_no_other_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its parts are of one moment though it grows meanwhile; once it is finished, the map in use is sent again."""
    monkeypatch.setattr(parts, "PART_BYTES", 30)
    save(MapStore(tmp_path), "flat", grid(1))
    revision = 4

    async def growing() -> MapChanged:
        nonlocal revision
        revision += 1
        percent = np.random.default_rng(revision).integers(-1, 101, (9, 13)).astype(np.int8)
        cells = zlib.compress(percent.tobytes())
        return MapChanged(1.0, revision, 0.05, Pose2D(-1.0, 2.0), 13, 9, 0, 0, 13, 9, cells, True)

    async def run() -> None:
        bus = Bus()
        service = MapsService(bus, LoopClock(), MapStore(tmp_path), 3)
        service.growing = growing
        await service.load_map(NOBODY, LoadMapParams(name="flat"), NOT_TOLD)
        bus.publish(mapping_told("mapping", None))
        first = await service.get_map(NOBODY, GetMapParams(), NOT_TOLD)
        assert (first.name, first.version, first.saved_at_s, first.parts > 2) == (None, 5, None, True)
        rest = [
            await service.get_map(NOBODY, GetMapParams(name=None, part=part), NOT_TOLD)
            for part in range(1, first.parts)
        ]
        assert {part.version for part in rest} == {5}
        packed = base64.b64decode("".join(part.data for part in (first, *rest)))
        other = await service.get_map(ANOTHER, GetMapParams(), NOT_TOLD)
        assert other.version == 6
        again = await service.get_map(NOBODY, GetMapParams(name=None, part=1), NOT_TOLD)
        assert again.version == 5  # or each client would make the other begin again
        expected = np.random.default_rng(5).integers(-1, 101, (9, 13)).astype(np.int8)
        assert zlib.decompress(packed) == expected.tobytes()
        assert (await service.get_map(NOBODY, GetMapParams(name="flat", part=0), NOT_TOLD)).name == "flat"
        bus.publish(mapping_told("idle", None))
        assert (await service.get_map(NOBODY, GetMapParams(), NOT_TOLD)).name == "flat"

    asyncio.run(run())


def importing(folder: Path) -> list[str]:
    """The processes that import into this folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            command = (process / "cmdline").read_bytes()
            if b"chefbotd.components.maps.storage.importing" in command and str(folder).encode() in command:
                found.append(process.name)
    return found


@pytest.mark.slow
def test_a_cancelled_import_ends_its_program_and_leaves_nothing(tmp_path: Path) -> None:
    """Somebody else changes the folder, and so it waits when it is cancelled."""
    folder = tmp_path / "maps"
    folder.mkdir()
    yaml = write_files(tmp_path, "x", grid(1))

    async def scenario(client: Client) -> None:
        saving = asyncio.Event()

        def note(_done: float, _total: float, text: str) -> None:
            if text == "saving":
                saving.set()

        with lock_folder(folder):
            work = asyncio.create_task(client.import_map(str(yaml), on_progress=note))
            await asyncio.wait_for(saving.wait(), PATIENCE_S)
            assert importing(folder)
            work.cancel()
            with pytest.raises(asyncio.CancelledError):
                await work
            await until(lambda: not importing(folder))
        assert (await client.import_map(str(yaml), "y")).version == 1
        assert [each.name for each in (await client.list_maps()).maps] == ["y"]

    with_daemon(folder, scenario)


@pytest.mark.parametrize("which", sample(["x.yaml", "x.pgm"]))
def test_what_is_no_regular_file_is_not_read(tmp_path: Path, which: str) -> None:
    """A FIFO would keep it waiting for ever, a device would never end."""
    write_files(tmp_path, "x", grid(1))
    (tmp_path / which).unlink()
    os.mkfifo(tmp_path / which)

    async def scenario(client: Client) -> None:
        with pytest.raises(CallError, match=f"{which}: expected a regular file"):
            await client.import_map(str(tmp_path / "x.yaml"))

    with_daemon(tmp_path / "maps", scenario)


def test_without_the_section_there_are_no_maps() -> None:
    """The methods are not there, and the greeting does not name them."""

    async def run() -> None:
        async with running_daemon(FakeSerialDevice()) as client:
            assert "method.list_maps" not in client.hello.capabilities
            with pytest.raises(CallError) as refused:
                await client.list_maps()
            assert refused.value.kind == "method_not_found"

    asyncio.run(run())
