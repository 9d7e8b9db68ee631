"""chefbotctl map edit, against a daemon that keeps maps."""

import json
from pathlib import Path

from chefbotd.cli.common.exits import Exit
from chefbotd.components.maps.storage.contents import read_grid, save
from chefbotd.components.maps.storage.store import MapStore
from tests.chefbotd.components.maps.cli.conftest import folder, mapctl
from tests.chefbotd.components.maps.storage.test_store import grid, same
from tests.chefbotd.conftest import Control

__all__ = ["folder", "mapctl"]
OF_ROOM = ("--map", "room")


def test_a_map_is_edited_listed_and_brought_back(mapctl: Control, folder: Path) -> None:
    """Negative numbers are coordinates; what is stored of the map stays as it was."""
    save(MapStore(folder), "room", grid(1))
    said = mapctl("map", "edit", "erase", "-1", "-1", "0", "-1", "0", "0.5", "--unknown", *OF_ROOM)
    assert said.output.startswith("The map room is edited; the edit's id is ")
    own = said.output.rstrip(".\n").rpartition(" ")[2]
    assert mapctl("map", "edit", "wall", "1", "1", "2", "1", "--width", "0.2", *OF_ROOM).exit_code == 0
    assert mapctl("map", "edit", "crop", "0", "0", "9", "0", "9", "9", "0", "9", *OF_ROOM).exit_code == 0
    assert (
        mapctl("map", "edit", "view", "-7", *OF_ROOM).output
        == "The map room is shown turned by -7 degrees.\n"
    )
    rows = mapctl("map", "edit", "list", *OF_ROOM).output.splitlines()
    assert [row.split()[1:] for row in rows if own in row] == [
        ["erased", "to", "unknown", "-1.00…0.00", "-1.00…0.50"]
    ]
    assert mapctl("map", "edit", "delete", own, *OF_ROOM).output == f"The edit {own} is deleted.\n"
    for _ in range(2):
        undone = mapctl("map", "edit", "undo", *OF_ROOM)
        assert undone.output == "The map room is as before its last change.\n"
    assert mapctl("map", "edit", "redo", *OF_ROOM).output == "The map room is changed again.\n"
    listed = json.loads(mapctl("map", "edit", "list", "--json", *OF_ROOM).output)
    assert [one["kind"] for one in listed["edits"]] == ["erase", "wall", "crop"]
    assert round(listed["view_angle_rad"], 4) == -0.1222
    assert same(read_grid(MapStore(folder), "room"), grid(1))


def test_nonsense_is_refused_with_what_was_expected(mapctl: Control, folder: Path) -> None:
    """An odd number, an edit that there is not, nothing to take back."""
    save(MapStore(folder), "room", grid(1))
    odd = mapctl("map", "edit", "wall", "1", "2", "3", *OF_ROOM)
    assert (odd.exit_code, "an X and a Y for each corner, got 3 numbers" in odd.output) == (Exit.USAGE, True)
    unknown = mapctl("map", "edit", "delete", "nobody", *OF_ROOM)
    assert unknown.exit_code == Exit.REFUSED
    assert "no edit with the id 'nobody'; there are: none" in unknown.output + unknown.stderr
    assert mapctl("map", "edit", "undo", *OF_ROOM).exit_code == Exit.REFUSED
