"""Two demonstrations at once: one folder belongs to one of them."""

from pathlib import Path

import pytest

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.maps.making import only_one_in
from tests.chefbotd.cli.conftest import Control


def test_a_second_demonstration_in_the_same_folder_is_refused(tmp_path: Path, control: Control) -> None:
    """It says what to do, and starts nothing; in another folder, or afterwards, it may."""
    with only_one_in(tmp_path / "map"):
        result = control("map", "demo", "--out", str(tmp_path / "map"))
        assert result.exit_code == Exit.NOT_DONE
        assert "give another folder with --out" in result.output
        with only_one_in(tmp_path / "other"):
            pass
    with only_one_in(tmp_path / "map"):
        assert (tmp_path / "map" / ".demo.lock").is_file()


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    """A file is in its place."""
    (tmp_path / "map").write_text("")
    with (
        pytest.raises(ProgramError, match=f"cannot write to {tmp_path / 'map'}"),
        only_one_in(tmp_path / "map"),
    ):
        pass
