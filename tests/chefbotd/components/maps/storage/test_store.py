"""The store of maps: what is saved is read again, versions, names, other people's files, and damage."""

import math
import threading
from pathlib import Path

import numpy as np
import pytest

from chefbotd.components.maps.storage.contents import (
    autosave,
    read_arrays,
    read_grid,
    read_map_server,
    read_slam,
    save,
)
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.maps.storage.manifest import CELLS, GRAPH, MANIFEST
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.core.commands import RefusalKind
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid

ORIGIN = Pose2D(-1.25, 2.5, 0.3)


def grid(seed: int, rows: int = 7, columns: int = 11) -> OccupancyGrid:
    """Cells of the three kinds that a trinary image keeps."""
    rng = np.random.default_rng(seed)
    percent = rng.choice(np.array([-1, 0, 100], np.int8), (rows, columns))
    return OccupancyGrid(0.05, ORIGIN, percent)


def same(one: OccupancyGrid, other: OccupancyGrid) -> bool:
    """Equal in every cell, and in where they lie."""
    return (
        one.resolution_m == other.resolution_m
        and one.map_from_grid == other.map_from_grid
        and np.array_equal(one.percent, other.percent)
    )


@pytest.fixture
def store(tmp_path: Path) -> MapStore:
    """A store that keeps two versions, in a folder that is not there yet."""
    return MapStore(tmp_path / "maps", versions_kept=2)


def test_a_map_is_read_as_it_was_saved(store: MapStore) -> None:
    """Every percentage, the origin with its heading, and SLAM's arrays bit for bit."""
    percent = np.arange(-1, 76, dtype=np.int8).reshape(7, 11)
    saved = OccupancyGrid(0.05, ORIGIN, percent)
    arrays = {"poses": np.array([[1.0, math.pi, -0.5]]), "sizes": np.array([3], np.int64)}
    assert save(store, "flat", saved, arrays) == 1
    assert same(read_grid(store, "flat"), saved)
    read = read_slam(store, "flat")
    assert read is not None
    assert read.keys() == arrays.keys()
    assert all(
        np.array_equal(read[key], value) and read[key].dtype == value.dtype for key, value in arrays.items()
    )
    described = store.describe("flat")
    assert described.manifest is not None
    assert described.manifest.can_go_on
    assert (described.manifest.extent.columns, described.manifest.extent.rows) == (11, 7)


def test_the_two_files_for_everybody_are_those_of_the_latest_version(store: MapStore) -> None:
    """NAME.yaml and NAME.pgm lie in the folder itself and are read as map_server reads them."""
    for seed in (1, 2):
        save(store, "Küche 2", grid(seed, columns=10 + seed))
    assert same(read_map_server(store.folder / "Küche 2.yaml").grid, grid(2, columns=12))
    assert (store.folder / "Küche 2.pgm").read_bytes().startswith(b"P5\n12 7\n255\n")
    text = (store.folder / "Küche 2.yaml").read_text()
    assert text.startswith('image: "K\\u00fcche 2.pgm"\nmode: trinary\nresolution: 0.05\n')


def test_as_many_versions_are_kept_as_configured(store: MapStore) -> None:
    """Of five saved, the last two."""
    for seed in range(5):
        save(store, "flat", grid(seed))
    assert store.describe("flat").versions == (5, 4)
    assert sorted(path.name for path in (store.folder / "flat.map").iterdir()) == ["v000004", "v000005"]


@pytest.mark.parametrize("file", [CELLS, MANIFEST])
@pytest.mark.parametrize("damage", ["cut", "changed", "missing", "empty"])
def test_a_damaged_version_gives_way_to_the_last_whole_one(store: MapStore, file: str, damage: str) -> None:
    """Whichever file is damaged and however, the version before it is read, and it is said what is wrong."""
    save(store, "flat", grid(1))
    save(store, "flat", grid(2))
    path = store.folder / "flat.map" / "v000002" / file
    data = path.read_bytes()
    if damage == "missing":
        path.unlink()
    else:
        flipped = bytes([data[-3] ^ 0x04])
        path.write_bytes({"cut": data[:-1], "changed": data[:-3] + flipped + data[-2:], "empty": b""}[damage])
    if (file, damage) == (MANIFEST, "cut"):  # without its last line end it says the same
        assert same(read_grid(store, "flat"), grid(2))
        return
    assert same(read_grid(store, "flat"), grid(1))
    version, told = store.read("flat")
    assert version.manifest.version == 1
    assert set(told) == {2}
    save(store, "flat", grid(3))
    assert same(read_grid(store, "flat"), grid(3))


def test_a_map_of_which_no_version_is_whole_says_what_is_wrong_with_each(store: MapStore) -> None:
    """It stays in the list, and can be saved anew."""
    save(store, "flat", grid(1))
    (store.folder / "flat.map" / "v000001" / CELLS).write_bytes(b"x")
    assert store.names() == ["flat"]
    with pytest.raises(
        MapStoreError, match=r"'flat' is whole: version 1: cells.zlib has 1 bytes instead of \d+"
    ) as failed:
        read_grid(store, "flat")
    assert failed.value.kind is RefusalKind.MAP_UNREADABLE


def test_a_manifest_that_leads_out_of_its_folder_is_none(store: MapStore) -> None:
    """Somebody's file cannot make the store read others."""
    save(store, "flat", grid(1))
    path = store.folder / "flat.map" / "v000001" / MANIFEST
    path.write_text(path.read_text().replace('"cells.zlib"', '"../../../secret"'))
    with pytest.raises(MapStoreError, match="is not a file name"):
        store.read("flat")


@pytest.mark.parametrize(
    "name", ["", ".", "..", "a/b", "../a", "/etc/passwd", ".hidden", "-rf", "a\0b", "a\nb", "a ", "a.", "a\\b", "x" * 65,
             "\u202eflat", "a:b", "~"]
)  # fmt: skip
def test_names_that_are_no_file_names_are_refused(store: MapStore, name: str) -> None:
    """Nothing is written, and what is expected is said."""
    with pytest.raises(MapStoreError, match="expected 1 to 64 letters") as refused:
        save(store, name, grid(1))
    assert refused.value.kind is RefusalKind.BAD_NAME
    assert not store.folder.exists()


def test_a_name_is_the_same_however_its_accents_are_written(store: MapStore) -> None:
    """One letter, or a letter and an accent, as other systems write it."""
    save(store, "Ku\u0308che", grid(1))
    assert store.names() == ["K\u00fcche"]
    assert same(read_grid(store, "K\u00fcche"), grid(1))


def test_a_name_is_told_as_it_is_written(store: MapStore) -> None:
    """In any script; only what cannot be printed is told by its number."""
    with pytest.raises(MapStoreError, match="no map named 'K\u00fcche'"):
        store.describe("K\u00fcche")
    with pytest.raises(MapStoreError, match=r"'K\u00fc\\u202eche' cannot be a map's name"):
        store.describe("K\u00fc\u202eche")


def test_an_unknown_map_names_those_there_are(store: MapStore) -> None:
    """Also where there is no folder yet, which reading does not make."""
    with pytest.raises(MapStoreError, match="no map named 'flat'; there are none"):
        store.describe("flat")
    assert not store.folder.exists()
    save(store, "cellar", grid(1))
    with pytest.raises(MapStoreError, match="no map named 'flat'; there are cellar") as unknown:
        read_grid(store, "flat")
    assert unknown.value.kind is RefusalKind.UNKNOWN_MAP


def test_a_map_is_renamed_with_its_versions_its_files_and_its_use(store: MapStore) -> None:
    """The old name is free again; a taken one is refused."""
    save(store, "flat", grid(1))
    save(store, "cellar", grid(2))
    store.change_beside("flat", "places.json", lambda _: b"{}")
    store.set_current("flat")
    with pytest.raises(MapStoreError, match="there is a map 'cellar' already"):
        store.rename("flat", "cellar")
    store.rename("flat", "home")
    assert store.names() == ["cellar", "home"]
    assert store.current() == "home"
    assert same(read_map_server(store.folder / "home.yaml").grid, grid(1))
    assert not list(store.folder.glob("flat*"))
    assert store.read_beside("home", "places.json") == b"{}"


def test_a_deleted_map_leaves_nothing(store: MapStore) -> None:
    """Neither files nor the memory of its use."""
    save(store, "flat", grid(1))
    store.set_current("flat")
    store.delete("flat")
    assert store.names() == []
    assert store.current() is None
    assert [path.name for path in store.folder.iterdir()] == [".lock"]
    with pytest.raises(MapStoreError, match="no map named"):
        store.delete("flat")


def test_files_that_somebody_put_there_are_a_map(store: MapStore) -> None:
    """They are listed, and need to be imported; with that they are a map like any other."""
    save(store, "flat", grid(1))
    for suffix in (".yaml", ".pgm"):
        (store.folder / f"theirs{suffix}").write_bytes(
            (store.folder / f"flat{suffix}").read_bytes().replace(b"flat.pgm", b"theirs.pgm")
        )
    assert store.names() == ["flat", "theirs"]
    assert store.describe("theirs").plain
    assert (store.needs_import("flat"), store.needs_import("theirs")) == (False, True)
    save(store, "theirs", read_map_server(store.folder / "theirs.yaml").grid)
    assert not store.needs_import("theirs")


@pytest.mark.parametrize("suffix", [".yaml", ".pgm"])
def test_a_file_that_somebody_edited_is_noticed_and_kept_when_it_is_replaced(
    store: MapStore, suffix: str
) -> None:
    """A door painted in, an origin set right: what was done is not lost by saving again."""
    save(store, "flat", grid(1))
    path = store.folder / f"flat{suffix}"
    changed = path.read_bytes()[:-1] + b"\n"
    path.write_bytes(changed if suffix == ".pgm" else changed + b"# mine\n")
    mine = path.read_bytes()
    assert store.needs_import("flat")
    save(store, "flat", grid(2))
    assert not store.needs_import("flat")
    assert (store.folder / "flat.map" / "replaced-by-v000002" / path.name).read_bytes() == mine


def test_what_is_being_mapped_has_a_place_of_its_own(store: MapStore) -> None:
    """It is in no list, the latest is read, and it can be forgotten."""
    assert store.read_autosave() is None
    for seed in (1, 2, 3):
        autosave(store, grid(seed), {"seed": np.array(seed)})
    assert store.names() == []
    version = store.read_autosave()
    assert version is not None
    assert int(read_arrays(version.folder / GRAPH)["seed"]) == 3
    (version.folder / GRAPH).write_bytes(b"")
    version = store.read_autosave()
    assert version is not None
    assert int(read_arrays(version.folder / GRAPH)["seed"]) == 2
    store.discard_autosave()
    assert store.read_autosave() is None
    store.discard_autosave()


def test_threads_that_save_at_once_each_save_a_version(tmp_path: Path) -> None:
    """Eight at the same time, with stores of their own, as other processes have: none overwrites another."""
    folder, wrong = tmp_path / "maps", []

    def one(seed: int) -> None:
        try:
            save(MapStore(folder, 20), "flat", grid(seed))
        except MapStoreError as error:
            wrong.append(error)

    threads = [threading.Thread(target=one, args=(seed,)) for seed in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []
    assert MapStore(folder).describe("flat").versions == tuple(range(8, 0, -1))


def test_a_folder_that_cannot_be_written_says_so_and_is_read_all_the_same(tmp_path: Path) -> None:
    """A file where the folder should be."""
    (tmp_path / "maps").write_text("no folder")
    store = MapStore(tmp_path / "maps")
    with pytest.raises(MapStoreError, match="cannot save the map 'flat': ") as failed:
        save(store, "flat", grid(1))
    assert failed.value.kind is RefusalKind.STORAGE_FAILED
    assert store.names() == []


def test_a_file_beside_the_versions_stays_with_its_map(store: MapStore) -> None:
    """Zones that a person wrote, through a new version and a new name."""
    save(store, "flat", grid(1))
    (store.folder / "flat.map" / "zones.yaml").write_bytes(b"keep_out: []")
    save(store, "flat", grid(2))
    store.rename("flat", "home")
    assert store.read_beside("home", "zones.yaml") == b"keep_out: []"
    assert store.read_beside("home", "places.json") is None


def test_twenty_versions_and_renames_lose_nothing_of_what_lies_beside_a_map(tmp_path: Path) -> None:
    """Its places, zones and edits are what they were, byte by byte; a copy has them too, and goes its own way."""
    store, beside = (
        MapStore(tmp_path, 2),
        {name: name.encode() for name in ("places.json", "zones.yaml", "edits.json")},
    )
    save(store, "home 0", grid(0))
    for name, content in beside.items():
        store.change_beside("home 0", name, lambda _, kept=content: kept)
    for number in range(20):
        save(store, f"home {number}", grid(number % 5))
        store.rename(f"home {number}", f"home {number + 1}")
    assert store.names() == ["home 20"]
    version = store.copy("home 20", "kept")
    assert version.manifest.version == 21
    store.change_beside("home 20", "zones.yaml", lambda _: b"changed")
    for name, content in beside.items():
        assert store.read_beside("kept", name) == content
        assert store.read_beside("home 20", name) == (b"changed" if name == "zones.yaml" else content)
    store.delete("home 20")
    assert same(read_grid(store, "kept"), grid(4))
    assert not store.needs_import("kept")


def test_a_map_is_not_copied_over_another_one(tmp_path: Path) -> None:
    """Nor is one that does not exist; both stay what they are."""
    store = MapStore(tmp_path)
    save(store, "flat", grid(1))
    save(store, "cellar", grid(2))
    with pytest.raises(MapStoreError, match="there is a map 'cellar' already"):
        store.copy("flat", "cellar")
    with pytest.raises(MapStoreError, match="no map named 'attic'"):
        store.copy("attic", "loft")
    assert (same(read_grid(store, "flat"), grid(1)), same(read_grid(store, "cellar"), grid(2))) == (
        True,
        True,
    )
