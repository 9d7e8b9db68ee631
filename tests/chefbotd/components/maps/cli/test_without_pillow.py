"""chefbotctl map where Pillow (extra maps) is not installed, neither here nor on the robot's computer."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from chefbotd.cli.common.exits import Exit
from chefbotd.cli.programs.chefbotctl import main
from chefbotd.components.maps.storage.contents import read_grid, read_map_server, save
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.maps.storage.store import MapStore
from tests.chefbotd.components.maps.cli.test_commands import ROOM
from tests.chefbotd.components.maps.storage.test_store import same
from tests.chefbotd.components.maps.test_service import write_files
from tests.chefbotd.conftest import Control
from tests.missing import PILLOW, hide

ADVICE = "pip install 'chefbotd[maps]'"


@pytest.fixture(autouse=True)
def _slim(monkeypatch: pytest.MonkeyPatch) -> None:
    hide(monkeypatch, *PILLOW)


def test_maps_are_saved_drawn_and_exported(mapctl: Control, folder: Path, tmp_path: Path) -> None:
    """What SLAM makes is stored, the terminal shows it, and PGM is written: none of it needs Pillow."""
    save(MapStore(folder), "room", ROOM)
    assert same(read_grid(MapStore(folder), "room"), ROOM)
    shown = mapctl("map", "show", "room").output.splitlines()
    assert shown[-1] == "room, version 1: 2.0 x 2.0 m, cells of 0.5 m"
    for mode in ("trinary", "raw"):
        exported = mapctl("map", "export", "--map", "room", "--mode", mode, str(tmp_path / mode))
        assert exported.exit_code == 0
        assert (tmp_path / mode / "room.pgm").read_bytes().startswith(b"P5\n4 4\n255\n")


@pytest.mark.parametrize(
    "command", [("map", "show", "--png", "x.png"), ("map", "export", ".", "--mode", "scale")]
)
def test_a_png_needs_it_and_that_is_told_before_the_robot_is_asked(command: tuple[str, ...]) -> None:
    """Exit code 7 and the command of pip, though no daemon answers at this address."""
    result = CliRunner().invoke(main, ["--connect=127.0.0.1:1", *command])
    assert result.exit_code == Exit.NOT_INSTALLED
    assert ADVICE in result.stderr


def test_a_maps_files_are_refused_with_what_to_install_on_the_robot(tmp_path: Path) -> None:
    """The refusal of an import, and of a map that was edited, names the file, Pillow and the command of pip."""
    yaml = write_files(tmp_path, "room", ROOM)
    with pytest.raises(MapStoreError, match=r"room\.yaml: Pillow.* robot's computer: ") as refused:
        read_map_server(yaml)
    assert ADVICE in str(refused.value)
