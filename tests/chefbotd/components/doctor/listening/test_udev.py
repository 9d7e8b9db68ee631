"""The udev rule of a board."""

import re

import pytest
from click.testing import CliRunner

from chefbotd.cli.common.exits import Exit
from chefbotd.cli.programs.chefbotctl import main
from chefbotd.components.doctor.listening import ports
from chefbotd.components.doctor.listening.ports import SerialPort
from chefbotd.components.doctor.listening.udev import udev_rule

UNO = SerialPort("/dev/ttyACM0", usb_id="2341:0043", serial_number="95032303837351F0B1A2")


def test_a_board_with_a_serial_number_is_known_by_it() -> None:
    """Matches and assignments as udev(7) has them: == compares, = assigns, += adds."""
    note, rule = udev_rule(UNO, "my-board").splitlines()
    assert note == "# 2341:0043 as /dev/my-board"
    assert rule == (
        'SUBSYSTEM=="tty", ATTRS{idVendor}=="2341", ATTRS{idProduct}=="0043", ATTRS{serial}=="95032303837351F0B1A2", '
        'SYMLINK+="my-board", GROUP="dialout", MODE="0660", ENV{ID_MM_DEVICE_IGNORE}="1"'
    )


def test_of_a_board_without_a_serial_number_it_is_said_what_else_matches() -> None:
    """A CH340 has none."""
    note, rule = udev_rule(SerialPort("/dev/ttyUSB0", usb_id="1a86:7523"), "khan").splitlines()
    assert note.endswith("every adapter of this kind matches: plug in only one")
    assert "serial" not in rule


def test_what_a_device_says_of_itself_cannot_break_out_of_the_rule() -> None:
    """A serial number with a quote, a pattern and a line's end."""
    rule = udev_rule(SerialPort("/dev/ttyUSB0", usb_id="1a86:7523", serial_number='a", RUN+="/x*\n'), "khan")
    assert len(rule.splitlines()) == 2
    assert re.search(r'ATTRS\{serial\}=="a\?. RUN\+=\?/x\?\?"', rule.replace(",", "."))


@pytest.mark.parametrize("name", ["", "a b", "../x", "a/b", 'a"'])
def test_a_name_that_is_none_is_refused(name: str) -> None:
    """Nothing but a file's plain name in /dev."""
    with pytest.raises(ValueError, match="is no name for a device"):
        udev_rule(UNO, name)


def test_the_command_prints_the_rule_alone_so_that_it_can_be_piped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it belongs goes to stderr; of two ports one is to be named, and a pseudo-terminal has no rule."""
    monkeypatch.setattr(ports, "serial_ports", lambda devices: [UNO])
    told = CliRunner().invoke(main, ["ports", "--udev", "my-board"])
    assert told.stdout == udev_rule(UNO, "my-board")
    assert "/etc/udev/rules.d/61-my-board.rules" in told.stderr
    monkeypatch.setattr(ports, "serial_ports", lambda devices: [UNO, UNO])
    assert CliRunner().invoke(main, ["ports", "--udev", "my-board"]).exit_code == 2
    monkeypatch.setattr(ports, "serial_ports", lambda devices: [SerialPort("/dev/pts/4")])
    refused = CliRunner().invoke(main, ["ports", "--udev", "my-board"])
    assert refused.exit_code == Exit.NOT_DONE
    assert "is not on USB" in refused.stderr


@pytest.mark.parametrize("found", [[], [SerialPort("/dev/ttyS0")]])
def test_a_board_without_its_driver_is_thought_of(
    monkeypatch: pytest.MonkeyPatch, found: list[SerialPort]
) -> None:
    """Nothing is on USB, whether the computer has a port of its own or not: lsusb tells, and brltty takes CH340s."""
    monkeypatch.setattr(ports, "serial_ports", lambda devices: found)
    told = CliRunner().invoke(main, ["ports"])
    assert told.exit_code == 0
    assert "If lsusb lists it, its driver is missing" in told.stdout
    assert "lsusb" not in CliRunner().invoke(main, ["ports", "/dev/ttyAMA0"]).stdout
    monkeypatch.setattr(ports, "serial_ports", lambda devices: [UNO])
    assert "lsusb" not in CliRunner().invoke(main, ["ports"]).stdout
