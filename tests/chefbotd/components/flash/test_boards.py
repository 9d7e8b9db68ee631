"""The table of boards and the command lines."""

from pathlib import Path

import pytest

from chefbotd.components.doctor.listening.ports import SerialPort
from chefbotd.components.flash.boards import AVRDUDE, DUEMILANOVE, LM4FLASH, OPENOCD, TIVA, choose

LAUNCHPAD = SerialPort("/dev/ttyACM0", usb_id="1cbe:00fd", serial_number="0E20B1C3")
FTDI = SerialPort("/dev/ttyUSB0", usb_id="0403:6001")
LIDAR = SerialPort("/dev/ttyUSB1", usb_id="10c4:ea60")


def test_the_only_known_board_is_found_by_its_usb_identifier() -> None:
    """Ports of other devices do not count."""
    assert choose([LIDAR, LAUNCHPAD], None, port_was_named=False) == (TIVA, LAUNCHPAD)
    assert choose([LAUNCHPAD, FTDI], DUEMILANOVE, port_was_named=False) == (DUEMILANOVE, FTDI)


@pytest.mark.parametrize(
    ("ports", "board", "named", "told"),
    [
        ([LIDAR], None, False, "no Tiva-C LaunchPad (EK-TM4C123GXL) or Arduino Duemilanove"),
        ([LAUNCHPAD], DUEMILANOVE, False, "no Arduino Duemilanove (ATmega328P) is plugged in"),
        (
            [LAUNCHPAD, FTDI],
            None,
            False,
            "2 boards are plugged in, say which with --port: /dev/ttyACM0 (Tiva",
        ),
        ([LIDAR], None, True, "/dev/ttyUSB1: its USB identifier 10c4:ea60 is no known board's"),
        ([SerialPort("/dev/pts/3")], None, True, "/dev/pts/3: it is no USB port; say which board"),
    ],
)
def test_a_board_that_cannot_be_told_is_refused_with_what_to_give(
    ports: list[SerialPort], board: object, named: bool, told: str
) -> None:
    """Nothing is guessed."""
    with pytest.raises(LookupError) as refusal:
        choose(ports, board, port_was_named=named)  # type: ignore[arg-type]
    assert told in str(refusal.value)


def test_a_named_port_with_a_named_board_is_taken_at_its_word() -> None:
    """A clone's USB converter has another identifier."""
    assert choose([LIDAR], DUEMILANOVE, port_was_named=True) == (DUEMILANOVE, LIDAR)


def test_the_command_lines_are_those_of_the_manual_pages() -> None:
    """One LaunchPad among several is chosen by its serial number."""
    image = Path("/x/a.bin")
    assert OPENOCD.write(LAUNCHPAD, image) == [
        *("openocd", "-f", "board/ti_ek-tm4c123gxl.cfg", "-c", "adapter serial 0E20B1C3"),
        *("-c", "program {/x/a.bin} verify reset exit 0x0"),
    ]
    assert OPENOCD.read is not None
    assert OPENOCD.read(LAUNCHPAD, image)[-8:] == [
        *("-c", "reset halt", "-c", "dump_image {/x/a.bin} 0x0 0x40000"),
        *("-c", "reset run", "-c", "shutdown"),
    ]
    assert LM4FLASH.write(LAUNCHPAD, image) == ["lm4flash", "-v", "-s", "0E20B1C3", "/x/a.bin"]
    assert AVRDUDE.write(FTDI, Path("/x/a.hex")) == [
        *("avrdude", "-qq", "-c", "arduino", "-p", "m328p", "-P", "/dev/ttyUSB0", "-b", "57600", "-D"),
        *("-U", "flash:w:/x/a.hex:i"),
    ]
