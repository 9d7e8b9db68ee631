"""The list of serial ports."""

import os
import tty
from pathlib import Path

import pytest

from chefbotd.components.doctor.listening import ports
from chefbotd.components.doctor.listening.ports import holder, permission_problem, serial_ports


@pytest.fixture
def pty() -> tuple[int, str]:
    """A pseudo-terminal, whose other end nobody else has open."""
    master, slave = os.openpty()
    tty.setraw(slave)
    path = os.ttyname(slave)
    os.close(slave)
    yield master, path  # type: ignore[misc]
    os.close(master)


def test_a_device_that_is_named(pty: tuple[int, str], tmp_path: Path):
    """A pseudo-terminal is described by its path, and by its lasting name where it has one."""
    link = tmp_path / "usb-ChefBot-if00"
    link.symlink_to(pty[1])
    (port,) = serial_ports((pty[1],), by_id=tmp_path)
    assert port.device == pty[1]
    assert port.by_id == str(link)
    assert not port.permission
    assert not port.usb_id


def test_a_named_device_that_is_not_there_cannot_be_opened(tmp_path: Path):
    """A name with a letter wrong is told as such, not as a free port."""
    (port,) = serial_ports((str(tmp_path / "ttyACM9"),))
    assert port.permission == "there is no such device"
    assert not port.held_by


def test_no_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A file that we may not open says which group may, or that its rule is to blame."""
    device = tmp_path / "board"
    device.touch()
    monkeypatch.setattr(ports.os, "access", lambda *_: False)
    assert "group" in permission_problem(str(device))
    assert not permission_problem(str(tmp_path / "none"))


def test_a_device_without_a_holder(pty: tuple[int, str], tmp_path: Path):
    """Nobody is nobody, also of a device that is not there."""
    assert not holder(str(tmp_path / "none"))
    assert not holder(pty[1])
