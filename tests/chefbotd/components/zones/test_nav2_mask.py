"""Masks of Nav2's costmap filters, as zones: the same cells, and the speeds that their CostmapFilterInfo means."""

import asyncio
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from chefbotd.cli.common.exits import Exit
from chefbotd.client import CallError
from chefbotd.components.maps.algorithms.map_server import ImageMode, to_description, to_image
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.navigation.algorithms.grid import GridFrame
from chefbotd.components.navigation.algorithms.zones import keep_out_cells, speed_limits_m_s
from chefbotd.components.zones.client_methods import ZoneMethods
from chefbotd.components.zones.models import AddZonesParams
from chefbotd.components.zones.nav2_mask import FilterInfo, MaskError, read_mask
from chefbotd.components.zones.zone_file import NO_ZONES, Zones, parse_zones, with_zones
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from tests.chefbotd.components.maps.cli.conftest import folder, mapctl
from tests.chefbotd.components.maps.storage.test_store import grid
from tests.chefbotd.conftest import Control

__all__ = ["folder", "mapctl"]
ORIGIN = Pose2D(-1.3, 2.7, 0.0)


def write_mask(
    path: Path, percent: NDArray[np.int8], mode: ImageMode = ImageMode.RAW, origin: Pose2D = ORIGIN
) -> OccupancyGrid:
    """A mask's two files, of cells of 5 cm."""
    mask = OccupancyGrid(0.05, origin, percent)
    image = path.with_suffix(".png" if mode is ImageMode.SCALE else ".pgm")
    path.write_text(to_description(mask, image.name, mode))
    image.write_bytes(to_image(mask, mode))
    return mask


def zones_of(path: Path, kind: str, info: FilterInfo) -> Zones:
    """The zones as the daemon keeps them."""
    read = AddZonesParams.model_validate({"zones": list(read_mask(path, kind, info).zones)})
    return with_zones(NO_ZONES, {str(n): shape.zone(str(n)) for n, shape in enumerate(read.zones)})


def blobs(seed: int) -> NDArray[np.int8]:
    """Circles of 0, 30, 60 and 100, with holes, and some cells that are unknown."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:80, :120]
    percent = np.zeros((80, 120), np.int8)
    for value in (30, 60, 100, 0, 100):
        percent[np.hypot(x - rng.uniform(0, 120), y - rng.uniform(0, 80)) < rng.uniform(5, 25)] = value
    percent[:4] = -1
    return percent


@pytest.mark.parametrize("mode", [ImageMode.RAW, ImageMode.SCALE])
@pytest.mark.parametrize("seed", range(5))
def test_a_keepout_mask_keeps_out_of_its_cells_of_100_and_of_no_other(
    tmp_path: Path, seed: int, mode: ImageMode
) -> None:
    """Cell by cell; what is only dearer is left out, and said."""
    path = tmp_path / "keepout.yaml"
    mask = write_mask(path, blobs(seed), mode)
    cells = keep_out_cells(zones_of(path, "keepout", FilterInfo()), GridFrame.of(mask))
    assert np.array_equal(cells, mask.percent == 100)
    assert any("only dearer" in note for note in read_mask(path, "keepout", FilterInfo()).notes)


@pytest.mark.parametrize(
    ("info", "m_s"),
    [
        (FilterInfo(0.0, 0.01), {30: 0.3, 60: 0.6, 100: 1.0}),
        (FilterInfo(1.1, -0.01), {30: 0.8, 60: 0.5, 100: 0.1}),
        (FilterInfo(percent_of_m_s=0.5), {30: 0.15, 60: 0.3, 100: 0.5}),
    ],
    ids=["type 2", "type 2, the other way round", "type 1"],
)
def test_a_speed_mask_limits_each_cell_to_the_speed_that_it_means(
    tmp_path: Path, info: FilterInfo, m_s: dict[int, float]
) -> None:
    """Base + multiplier * value, in m/s or in percent of the speed that is given; 0 and unknown have no limit."""
    path = tmp_path / "speed.yaml"
    mask = write_mask(path, blobs(2))
    limits = speed_limits_m_s(zones_of(path, "speed", info), GridFrame.of(mask))
    expected = np.full(limits.shape, np.inf)
    for value, speed_m_s in m_s.items():
        expected[mask.percent == value] = speed_m_s
    assert np.allclose(limits, expected)
    assert len(set(limits[np.isfinite(limits)].tolist())) > 1


@pytest.mark.parametrize(
    ("kind", "info", "origin", "value", "problem"),
    [
        ("keepout", FilterInfo(), Pose2D(0, 0, 0.3), 100, "its origin is turned by 0.3 rad, and Nav2 takes no turned"),
        ("keepout", FilterInfo(), ORIGIN, 40, "nothing is in it"),
        ("speed", FilterInfo(), ORIGIN, 0, "nothing is in it"),
        ("speed", FilterInfo(), ORIGIN, 40, "a cell of 40 stands for 40 m/s: expected a speed above 0 and up to 10"),
        ("speed", FilterInfo(-50, 1, 0.5), ORIGIN, 40, "a cell of 40 stands for -10 % of the speed"),
    ],
)  # fmt: skip
def test_what_is_no_mask_of_zones_is_refused_with_what_is_wrong(
    tmp_path: Path, kind: str, info: FilterInfo, origin: Pose2D, value: int, problem: str
) -> None:
    """A turned origin, nothing in it, values that are no speeds."""
    path = tmp_path / "mask.yaml"
    write_mask(path, np.full((10, 10), value, np.int8), origin=origin)
    with pytest.raises(MaskError) as refused:
        read_mask(path, kind, info)
    assert problem in str(refused.value)


def test_a_mask_of_specks_is_refused(tmp_path: Path) -> None:
    """A chessboard of 50 by 50 cells has 1250 areas."""
    path = tmp_path / "specks.yaml"
    write_mask(path, (np.indices((50, 50)).sum(axis=0) % 2 * 100).astype(np.int8))
    with pytest.raises(MaskError, match="1250 areas with 5000 corners; at most 200 with 5000 can be drawn"):
        read_mask(path, "keepout", FilterInfo())


def test_a_mask_of_noise_is_refused_before_it_is_traced(tmp_path: Path) -> None:
    """A chessboard of 500 by 500 cells has 125,000 pieces; tracing 16 million cells of noise took minutes."""
    path = tmp_path / "noise.yaml"
    write_mask(path, (np.indices((500, 500)).sum(axis=0) % 2 * 100).astype(np.int8))
    with pytest.raises(MaskError, match="its cells lie in 125000 pieces of rows"):
        read_mask(path, "keepout", FilterInfo())


@pytest.mark.parametrize(
    "head", [b"P5\nNaN 10\n255\n", b"P5\n10 10\n0\n", b"P5\n10 10\n70000\n", b"P5\n10 10\n"]
)
def test_an_image_with_an_odd_head_is_refused_by_its_name(tmp_path: Path, head: bytes) -> None:
    """Its size is no number, or its brightest grey none that there is."""
    path = tmp_path / "mask.yaml"
    write_mask(path, np.full((10, 10), 100, np.int8))
    path.with_suffix(".pgm").write_bytes(head + bytes(100))
    with pytest.raises(MapStoreError, match=r"mask\.pgm: cannot be read as an image"):
        read_mask(path, "keepout", FilterInfo())


def test_a_mask_is_imported_and_taken_back_at_once(mapctl: Control, folder: Path, tmp_path: Path) -> None:
    """All its zones are new, and one undo takes all of them back; what cannot be read is said."""
    save(MapStore(folder), "room", grid(1))
    percent = np.zeros((20, 20), np.int8)
    percent[2:5, 2:5] = percent[10:15, 10:18] = 100
    write_mask(tmp_path / "keepout.yaml", percent)
    of_room = ("--map", "room")
    said = mapctl("zones", "import", str(tmp_path / "keepout.yaml"), "--kind", "keepout", *of_room)
    assert said.output == "2 zones of keepout.yaml drawn on the map room.\n"
    listed = json.loads(mapctl("zones", "list", "--json", *of_room).output)
    assert [(zone["name"], zone["kind"]) for zone in listed["zones"]] == [
        ("keepout 1", "keep_out"),
        ("keepout 2", "keep_out"),
    ]
    assert mapctl("zones", "undo", *of_room).exit_code == 0
    assert json.loads(mapctl("zones", "list", "--json", *of_room).output)["zones"] == []
    lost = mapctl("zones", "import", str(tmp_path / "absent.yaml"), "--kind", "keepout", *of_room)
    assert lost.exit_code == Exit.FAILED
    assert "absent.yaml" in lost.stderr


def test_a_mask_that_is_too_long_for_one_request_is_imported_and_taken_back_at_once(
    mapctl: Control, folder: Path, tmp_path: Path
) -> None:
    """Ten circles have more corners than one request holds; every cell of theirs is kept out of, and of no other."""
    save(MapStore(folder), "room", grid(1))
    y, x = np.mgrid[:200, :500]
    percent = np.zeros((200, 500), np.int8)
    for number in range(10):
        percent[np.hypot(x - 50 - 100 * (number % 5), y - 50 - 100 * (number // 5)) < 45] = 100
    mask = write_mask(tmp_path / "keepout.yaml", percent)
    of_room = ("--map", "room")
    assert mapctl("zones", "add", "stairs", "50", "50", "51", "50", "51", "51", *of_room).exit_code == 0
    said = mapctl("zones", "import", str(tmp_path / "keepout.yaml"), "--kind", "keepout", *of_room)
    assert said.exit_code == 0, said.stderr
    file = folder / "room.map" / "zones.yaml"
    assert file.stat().st_size > 4096
    zones = parse_zones(file.read_text(), file.name)
    assert np.array_equal(keep_out_cells(zones, GridFrame.of(mask)), percent == 100)
    assert mapctl("zones", "undo", *of_room).exit_code == 0
    listed = json.loads(mapctl("zones", "list", "--json", *of_room).output)
    assert [zone["name"] for zone in listed["zones"]] == ["stairs"]


def test_a_part_that_is_refused_takes_back_those_before_it() -> None:
    """The client's requests, and what it does where the third of them is refused."""
    asked: list[tuple[str, Any]] = []

    class Caller(ZoneMethods):
        async def call(self, method: str, /, **params: Any) -> dict[str, Any]:
            params.pop("on_progress")
            asked.append((method, params))
            if len(asked) == 3:
                raise CallError(-32000, "needs_confirmation", "it covers the robot")
            return {"map": "flat", "revision": f"r{len(asked)}"}

    zone = {"kind": "keep_out", "points_m": [[round(0.1234 * k, 4), 1.0] for k in range(100)]}
    with pytest.raises(CallError):
        asyncio.run(Caller().add_zones([zone] * 8))
    assert [(method, params.get("map"), params.get("revision")) for method, params in asked] == [
        ("add_zones", None, None),
        ("add_zones", "flat", "r1"),
        ("add_zones", "flat", "r2"),
        ("undo_zones", "flat", "r2"),
    ]
    assert [params.get("continued") for _, params in asked] == [None, True, True, None]
