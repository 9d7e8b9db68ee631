"""Why a port cannot be opened, and what to do about it."""

import errno
import grp
import os
from pathlib import Path
from types import SimpleNamespace

import pytest
from serial.tools import list_ports

from chefbotd.link.ports import advice

ABSENT = OSError(errno.ENOENT, "No such file or directory")
DENIED = OSError(errno.EACCES, "Permission denied")


def plug(monkeypatch: pytest.MonkeyPatch, *devices: Path | str) -> None:
    """Let these be the computer's serial ports."""
    ports = [SimpleNamespace(device=str(device)) for device in devices]
    monkeypatch.setattr(list_ports, "comports", lambda: ports)


def test_an_absent_device_is_told_with_the_ports_that_are_there(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Those that have a lasting name by that, in order."""
    by_id, board, other = tmp_path / "by-id", tmp_path / "ttyACM1", tmp_path / "ttyUSB0"
    by_id.mkdir()
    board.touch()
    (by_id / "usb-Texas_Instruments-if00").symlink_to("../ttyACM1")
    plug(monkeypatch, other, board)
    assert advice("/dev/ttyACM0", ABSENT, by_id) == (
        f"there is no such device; available serial ports: {by_id}/usb-Texas_Instruments-if00 ({board}), {other}"
    )


def test_no_port_at_all(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Then it is the cable, or the power."""
    plug(monkeypatch)
    told = advice("/dev/ttyACM0", ABSENT, tmp_path / "no-such-folder")
    assert "no serial port was found" in told
    assert "plugged in and powered" in told


@pytest.mark.parametrize(
    ("groups", "told"),
    [
        (
            [4, 24],
            "only members of the group dialout may use it: run 'sudo usermod -aG dialout $USER', then log out",
        ),
        ([4, 20], "does not allow your group dialout to read and write: check its udev rule"),
    ],
)
def test_a_device_of_another_group(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, groups: list[int], told: str
) -> None:
    """Whoever is not in the group is told how to join it; who is, that this is not why."""
    device = tmp_path / "ttyACM0"
    device.touch()
    status = SimpleNamespace(st_gid=20)
    monkeypatch.setattr(Path, "stat", lambda _path: status)
    monkeypatch.setattr(grp, "getgrgid", lambda gid: SimpleNamespace(gr_name={20: "dialout"}[gid]))
    monkeypatch.setattr(os, "getgroups", lambda: groups)
    said = advice(str(device), DENIED)
    assert said.startswith("permission denied; ")
    assert told in said


def test_a_device_that_goes_meanwhile(tmp_path: Path) -> None:
    """Nothing is known of it then; any other error speaks for itself."""
    gone = str(tmp_path / "gone")
    assert advice(gone, DENIED) == "permission denied; is this user allowed to use it?"
    assert advice(gone, OSError("Could not configure port")) == "Could not configure port"
