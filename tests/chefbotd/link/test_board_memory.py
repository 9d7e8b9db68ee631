"""What is kept of a board beyond the end of the daemon."""

import errno
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from chefbotd.link.board_memory import BoardFile


def test_each_device_has_its_own_board(tmp_path: Path) -> None:
    """What is kept of one is not known of another; what is taken back is forgotten, also twice."""
    first, second = (BoardFile(tmp_path / "boards", device) for device in ("/dev/ttyACM0", "/dev/ttyACM1"))
    first.store(True)
    assert (first.recall(), second.recall()) == (True, False)
    first.store(False)
    first.store(False)
    assert not first.recall()


def test_a_folder_that_cannot_be_made_is_logged_and_stops_nothing(tmp_path: Path) -> None:
    """A file is in its place: nothing is kept, and the log says so."""
    (tmp_path / "boards").write_text("")
    with capture_logs() as logged:
        board = BoardFile(tmp_path / "boards", "/dev/ttyACM0")
        board.store(True)
    assert not board.recall()
    assert [entry["log_level"] for entry in logged] == ["warning"]


def test_what_cannot_be_looked_up_is_logged_and_stops_no_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder that this user may not search: nothing is known of the board."""

    def refuse(path: Path) -> bool:
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(Path, "is_file", refuse)
    with capture_logs() as logged:
        assert not BoardFile(tmp_path, "/dev/ttyACM0").recall()
    assert [entry["log_level"] for entry in logged] == ["warning"]
