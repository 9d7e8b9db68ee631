"""chefbotctl map and chefbotctl places, against a daemon that keeps maps."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from chefbotd.cli.common.exits import Exit
from chefbotd.components.maps.algorithms.map_server import parse_description, parse_image
from chefbotd.components.maps.storage.contents import read_grid, save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from tests.chefbotd.components.maps.storage.test_store import grid, same
from tests.chefbotd.components.maps.test_service import write_files
from tests.chefbotd.conftest import Control

ROOM = OccupancyGrid(
    0.5,
    Pose2D(-1.0, 0.5),
    np.flipud(
        np.array(
            [[100, 100, 100, 100], [100, 0, 0, 100], [100, 0, 30, -1], [100, 100, -1, -1]],
            np.int8,
        )
    ).copy(),
)


def test_a_map_is_imported_listed_loaded_and_shown(mapctl: Control, tmp_path: Path) -> None:
    """The picture has the walls and the place; a pipe is no terminal, so it has no colours."""
    yaml = write_files(tmp_path, "room", ROOM)
    said = mapctl("map", "import", str(yaml))
    assert said.exit_code == 0
    assert said.output.startswith(
        "Stored as the map room, version 1. 'chefbotctl map load' uses it. Beware: "
    )
    assert "a resolution of 0.5 m makes it 2 by 2 m" in said.output
    assert mapctl("map", "load", "room").exit_code == Exit.REFUSED
    assert "room (version 1)" in mapctl("map", "load", "room", "--resolution-is-right").output
    assert (
        mapctl("places", "save", "stove", "0.25", "1.75", "-90").output
        == "stove is at (0.25 m, 1.75 m, -90°).\n"
    )
    shown = mapctl("map", "show").output.splitlines()
    assert shown == ["█▀●s", "█▄░░", "room, version 1: 2.0 x 2.0 m, cells of 0.5 m"]
    (row,) = [line for line in mapctl("map", "list").output.splitlines() if "room" in line]
    assert "2.0 x 2.0 m" in row
    assert row.split()[-3:] == ["1", "in", "use"]
    listed = json.loads(mapctl("map", "list", "--json").output)
    assert (listed["in_use"], listed["maps"][0]["rows"]) == ("room", 4)


def test_that_there_is_no_map_yet_is_said(mapctl: Control, folder: Path) -> None:
    """In a sentence with the folder, not as an empty table; scripts get an empty list."""
    assert f"There is no map in {folder} yet." in mapctl("map", "list").output.replace("\n", "")
    assert json.loads(mapctl("map", "list", "--json").output)["maps"] == []


def test_a_map_is_shown_as_a_png_with_its_places(mapctl: Control, folder: Path, tmp_path: Path) -> None:
    """Enlarged, walls dark, and a dot where the place is; an existing file is replaced only if that is said."""
    save(MapStore(folder), "room", ROOM)
    mapctl("places", "save", "stove", "0.25", "1.75", "--map", "room")
    png = tmp_path / "room.png"
    assert mapctl("map", "show", "room", "--png", str(png)).exit_code == 0
    image = Image.open(io.BytesIO(png.read_bytes()))
    assert image.size == (32, 32)
    assert image.getpixel((2, 2)) == (20, 20, 24)
    assert image.getpixel((20, 12)) == (200, 30, 45)
    again = mapctl("map", "show", "room", "--png", str(png))
    assert (again.exit_code, again.stderr) == (
        Exit.FAILED,
        f"Error: {png} exists already; --force replaces it\n",
    )
    assert mapctl("map", "show", "room", "--png", str(png), "--force").exit_code == 0


@pytest.mark.parametrize(("mode", "suffix"), [("trinary", ".pgm"), ("scale", ".png"), ("raw", ".pgm")])
def test_exported_files_are_map_servers(
    mapctl: Control, folder: Path, tmp_path: Path, mode: str, suffix: str
) -> None:
    """Read again they are the same map, in a mode that keeps percentages with these."""
    percent = np.random.default_rng(5).integers(-1, 101, (9, 13)).astype(np.int8)
    stored = OccupancyGrid(0.05, Pose2D(1.0, -2.0, 0.25), percent) if mode != "trinary" else grid(5)
    save(MapStore(folder), "Küche", stored)
    out = tmp_path / "out"
    said = mapctl("map", "export", str(out), "--map", "Küche", "--mode", mode)
    assert str(out / "Küche.yaml") in said.output
    assert str(out / f"Küche{suffix}") in said.output
    description = parse_description((out / "Küche.yaml").read_text(), "Küche.yaml")
    assert description.image == f"Küche{suffix}"
    assert same(parse_image((out / description.image).read_bytes(), description), stored)
    assert mapctl("map", "export", str(out), "--map", "Küche", "--mode", mode).exit_code == Exit.FAILED


def test_maps_are_renamed_and_deleted(mapctl: Control, folder: Path) -> None:
    """Deleting asks first; a name that is unknown is told with those there are."""
    save(MapStore(folder), "flat", grid(1))
    assert mapctl("map", "rename", "flat", "home").exit_code == 0
    assert same(read_grid(MapStore(folder), "home"), grid(1))
    assert mapctl("map", "copy", "home", "kept").output == "The map home is kept as kept, too.\n"
    assert same(read_grid(MapStore(folder), "kept"), grid(1))
    assert mapctl("map", "delete", "kept", "--yes").exit_code == 0
    refused = mapctl("map", "delete", "flat", "--yes")
    assert refused.exit_code == Exit.REFUSED
    assert refused.stderr.startswith("Error: unknown_map: ")
    assert "'flat'" in refused.stderr
    assert "home" in refused.stderr
    assert mapctl("map", "delete", "home").exit_code == 1
    assert MapStore(folder).names() == ["home"]
    assert mapctl("map", "delete", "home", "--yes").exit_code == 0
    assert MapStore(folder).names() == []


def test_places_are_listed_and_deleted(mapctl: Control, folder: Path) -> None:
    """With their pose in metres and degrees."""
    save(MapStore(folder), "flat", grid(1))
    mapctl("map", "load", "flat")
    saved = mapctl("places", "save", "table 3", "-1.5", "2", "90")
    assert "table 3" in saved.output
    assert "(-1.50 m, 2.00 m, 90°)" in saved.output
    (row,) = [line for line in mapctl("places", "list").output.splitlines() if "table 3" in line]
    assert row.split() == ["table", "3", "-1.50", "2.00", "90°"]
    assert mapctl("places", "delete", "table 3").exit_code == 0
    assert json.loads(mapctl("places", "list", "--json").output) == {"map": "flat", "places": []}
    lost = mapctl("places", "save", "here")
    assert lost.exit_code == Exit.REFUSED
    assert lost.stderr.startswith(
        "Error: pose_unknown: where the robot is in the map 'flat' is not known (nothing tells it at present): wait"
    )


@pytest.mark.parametrize(
    ("args", "code", "told"),
    [
        (["map", "show"], Exit.REFUSED, "no_map_loaded: no map is in use: load one, or name one"),
        (["map", "load", "../secret"], Exit.REFUSED, "bad_name: '../secret' cannot be a map's name"),
        (["map", "import", "nowhere.yaml"], Exit.REFUSED, "nowhere.yaml: cannot be read: No such file"),
        (["places", "save", "x", "1"], Exit.USAGE, "X needs a Y with it"),
        (["places", "save", "x", "nan", "0"], Exit.USAGE, "'nan' is not finite"),
        (["map", "load", "x" * 65], Exit.REFUSED, "invalid_params: name: String should have at most 64"),
    ],
)
def test_nonsense_is_told_clearly(mapctl: Control, args: list[str], code: Exit, told: str) -> None:
    """What was wrong, in one sentence, and no traceback."""
    result = mapctl(*args)
    assert result.exit_code == code
    assert told in result.stderr


def test_a_daemon_without_maps_says_so(without_maps: Control) -> None:
    """And what its configuration lacks."""
    result = without_maps("map", "list")
    assert result.exit_code == Exit.REFUSED
    assert "this daemon keeps no maps: its configuration has no section [maps]" in result.stderr
