"""chefbotctl zones, against a daemon that keeps maps."""

import json
import math
from pathlib import Path

from chefbotd.cli.common.exits import Exit
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from tests.chefbotd.components.maps.cli.conftest import folder, mapctl
from tests.chefbotd.components.maps.storage.test_store import grid
from tests.chefbotd.conftest import Control

__all__ = ["folder", "mapctl"]
OF_ROOM = ("--map", "room")


def test_zones_are_drawn_switched_deleted_and_brought_back(mapctl: Control, folder: Path) -> None:
    """Negative numbers are coordinates; the list has what was drawn, and says whether it counts."""
    save(MapStore(folder), "room", grid(1))
    said = mapctl("zones", "add", "stairs", "-1", "-1", "0", "-1", "0", "0.5", *OF_ROOM)
    assert said.output.startswith("The zone stairs is drawn; its id is ")
    own = said.output.rstrip(".\n").rpartition(" ")[2]
    assert (
        mapctl("zones", "add", "hall", "1", "0", "2", "0", "2", "1", "--slow", "0.1", *OF_ROOM).exit_code == 0
    )
    assert mapctl("zones", "add", "rope", "1", "1", "2", "1", "--wall", *OF_ROOM).exit_code == 0
    assert mapctl("zones", "off", own, *OF_ROOM).output == f"The zone {own} does not count.\n"
    (row,) = [line for line in mapctl("zones", "list", *OF_ROOM).output.splitlines() if "stairs" in line]
    assert row.split() == [own, "keep", "out", "stairs", "-1.00…0.00", "-1.00…0.50", "no"]
    assert mapctl("zones", "on", own, *OF_ROOM).output == f"The zone {own} counts.\n"
    assert mapctl("zones", "delete", own, *OF_ROOM).output == f"The zone {own} is deleted.\n"
    assert mapctl("zones", "undo", *OF_ROOM).output == "The zones of room are as before.\n"
    listed = json.loads(mapctl("zones", "list", "--json", *OF_ROOM).output)
    assert [(zone["name"], zone["kind"], zone["enabled"]) for zone in listed["zones"]] == [
        ("stairs", "keep_out", True),
        ("hall", "slow", True),
        ("rope", "wall", True),
    ]


def test_nonsense_is_refused_with_what_was_expected(mapctl: Control, folder: Path) -> None:
    """An odd number, a speed for a wall, an id that no zone has."""
    save(MapStore(folder), "room", grid(1))
    odd = mapctl("zones", "add", "a", "1", "2", "3", *OF_ROOM)
    assert (odd.exit_code, "an X and a Y for each corner, got 3 numbers" in odd.output) == (Exit.USAGE, True)
    both = mapctl("zones", "add", "a", "1", "2", "3", "4", "--wall", "--slow", "0.1", *OF_ROOM)
    assert "a wall has no speed" in both.output
    unknown = mapctl("zones", "on", "nobody", *OF_ROOM)
    assert unknown.exit_code == Exit.REFUSED
    assert "no zone with the id 'nobody'; there are: none" in unknown.output + unknown.stderr


def test_corners_that_were_computed_fit_into_a_request(mapctl: Control, folder: Path) -> None:
    """150 corners with all digits of a number have 6 kB, and a request 4: they are sent to a tenth of a millimetre."""
    save(MapStore(folder), "room", grid(1))
    angles = [2 * math.pi * number / 150 for number in range(150)]
    numbers = [repr(20 * value) for angle in angles for value in (math.cos(angle), math.sin(angle))]
    assert len(" ".join(numbers)) > 5000
    said = mapctl("zones", "add", "round", *numbers, *OF_ROOM)
    assert said.exit_code == 0, said.stderr
