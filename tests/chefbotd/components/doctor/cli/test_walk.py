"""Whose board the doctor looks at."""

from pathlib import Path

import pytest

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.components.doctor.cli.walk import require_same


def test_a_board_that_the_daemon_does_not_drive_is_refused() -> None:
    """With --motors another robot than the one that was named would drive."""
    with pytest.raises(
        ProgramError, match=r"--port /dev/ttyACM1: the daemon at .* uses /dev/ttyACM0"
    ) as refused:
        require_same("/dev/ttyACM1", "/dev/ttyACM0", "127.0.0.1:7333")
    assert refused.value.code == Exit.USAGE


def test_another_name_of_the_daemon_s_board_is_that_board(tmp_path: Path) -> None:
    """A lasting name is a symbolic link; without --port there is nothing to compare."""
    device, name = tmp_path / "ttyACM0", tmp_path / "usb-LaunchPad"
    device.touch()
    name.symlink_to(device)
    require_same(str(name), str(device), "127.0.0.1:7333")
    require_same(None, str(device), "127.0.0.1:7333")
