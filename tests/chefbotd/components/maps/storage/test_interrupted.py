"""A change of the store that is cut off at any of its operations, in any way, leaves the old state or the new one."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from chefbotd.components.maps.storage.contents import read_grid, read_map_server, read_slam, save
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.core.commands import RefusalKind
from tests.budget import sample
from tests.chefbotd.components.maps.storage.disks import BROKEN, FULL, READ_ONLY, FailingDisk, Killed
from tests.chefbotd.components.maps.storage.test_store import grid, same

State = dict[str, tuple[int, list[bytes | None]]]
BESIDE = ("places.json", "zones.yaml", "edits.json")
Change = Callable[[MapStore], object]
SEEDS = (1, 2, 3, 4)

CHANGES: dict[str, Change] = {
    "save again": lambda store: save(store, "flat", grid(3, columns=13), {"seed": np.array(3)}),
    "save anew": lambda store: save(store, "new", grid(4, rows=3), {"seed": np.array(4)}),
    "rename": lambda store: store.rename("flat", "home"),
    "delete": lambda store: store.delete("flat"),
    "copy": lambda store: store.copy("flat", "kept"),
    "places": lambda store: store.change_beside("flat", "places.json", lambda _: b"new"),
    "zones": lambda store: [
        store.change_beside("flat", file, lambda _: b"new") for file in ("zones-before.yaml", "zones.yaml")
    ],
    "edits": lambda store: store.change_beside("flat", "edits.json", lambda _: b"new"),
}


def fill(folder: Path) -> None:
    """Two versions of one map, which is in use, and another map."""
    store = MapStore(folder, 2)
    for seed in (1, 2):
        save(store, "flat", grid(seed), {"seed": np.array(seed)})
    save(store, "cellar", grid(1))
    for file in BESIDE:
        store.change_beside("flat", file, lambda _, name=file: f"old {name}".encode())
    store.set_current("flat")


def seed_of(store: MapStore, name: str) -> int:
    """Which of the four grids a map has."""
    read = read_grid(store, name)
    sizes = {3: {"columns": 13}, 4: {"rows": 3}}
    return next(seed for seed in SEEDS if same(read, grid(seed, **sizes.get(seed, {}))))


def state(folder: Path) -> State:
    """By map: its cells, and its places, zones and edits. The graph must belong to these cells."""
    store, found = MapStore(folder, 2), {}
    for name in store.names():
        seed = seed_of(store, name)
        slam = read_slam(store, name)
        assert slam is None or int(slam["seed"]) == seed
        found[name] = (seed, [store.read_beside(name, file) for file in BESIDE])
    return found


def check_public(folder: Path) -> None:
    """Whatever YAML there is leads to an image that belongs to it, also before anybody has repaired anything."""
    for path in folder.glob("[!.]*.yaml"):
        public = read_map_server(path).grid
        sizes = {3: {"columns": 13}, 4: {"rows": 3}}
        assert any(same(public, grid(seed, **sizes.get(seed, {}))) for seed in SEEDS)


@pytest.mark.parametrize("how", sample(["kill", "power cut", FULL, BROKEN], fast=1))
@pytest.mark.parametrize("what", sample(CHANGES))
def test_cut_off_anywhere_it_is_the_old_state_or_the_new_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str, how: int | str
) -> None:
    """And the next change finishes or removes what was left: no file lies about, and the public files are right."""
    monkeypatch.setattr(os, "fsync", lambda _: None)  # the page cache is not cut off by this
    change = CHANGES[what]
    before, after = tmp_path / "before", tmp_path / "after"
    fill(before)
    shutil.copytree(before, after)
    change(MapStore(after, 2))
    old, new, in_use = state(before), state(after), MapStore(before, 2).current()
    assert old != new
    told: list[tuple[RefusalKind, str]] = []
    at, refused, finished = 0, 0, False
    while not finished:
        at += 1
        folder = tmp_path / f"run{at}"
        shutil.copytree(before, folder)
        disk = FailingDisk(at, how)
        try:
            change(MapStore(folder, 2, disk))
            finished = disk.count < at
        except Killed:
            pass
        except MapStoreError as error:
            told.append((error.kind, str(error)))
        check_public(folder)
        left = state(folder)
        if len(told) > refused:  # it says that nothing was done
            refused = len(told)
            assert (left, MapStore(folder, 2).current()) == (old, in_use), (at, told[-1])
        assert left in (old, new), (at, left)
        MapStore(folder, 2).change_beside("cellar", "note", lambda _: b"")  # any change repairs first
        assert state(folder) == left
        check_tidy(folder)
        shutil.rmtree(folder)
    assert at > 5
    assert all(kind is RefusalKind.STORAGE_FAILED and "(somewhere)" in text for kind, text in told)
    assert bool(told) == isinstance(how, int)


@pytest.mark.parametrize(
    ("number", "words"),
    [(FULL, "the disk is full"), (READ_ONLY, "the file system is read-only"), (BROKEN, "the disk cannot be")],
)
def test_why_a_disk_refuses_is_said_in_words(tmp_path: Path, number: int, words: str) -> None:
    """What was to be done, and where it failed."""
    store = MapStore(tmp_path, disk=FailingDisk(5, number))
    with pytest.raises(MapStoreError, match=f"cannot save the map 'flat': {words}.* \\(somewhere\\)"):
        save(store, "flat", grid(1))
    assert store.names() == []


def check_tidy(folder: Path) -> None:
    """Nothing temporary is left, and each map's two files are those of its latest version."""
    hidden = {path.name for path in folder.rglob(".*")} - {".lock", ".current.json"}
    assert hidden == set()
    store = MapStore(folder, 2)
    for name in store.names():
        assert not store.needs_import(name)
        assert same(read_map_server(folder / f"{name}.yaml").grid, read_grid(store, name))
    maps = {f"{name}{suffix}" for name in store.names() for suffix in (".yaml", ".pgm", ".map")}
    assert {path.name for path in folder.iterdir() if not path.name.startswith(".")} == maps
    assert store.current() in (None, *store.names())
