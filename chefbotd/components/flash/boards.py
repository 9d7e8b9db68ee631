"""The boards that can be flashed, and the command lines of Debian's programs that do it.

Not one of these command lines was tried on a physical board. avrdude was run against a simulated boot loader
(``tests/chefbotd/components/flash``); those of openocd and lm4flash follow their manual pages and openocd's board file.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

from chefbotd.components.doctor.listening.ports import SerialPort
from chefbotd.core.record import Record

CommandLine = list[str]


class Programmer(Record, frozen=True):
    """A program of Debian's that reads and writes a board's flash memory; ``read`` is None where it cannot read.

    ``formats`` are the endings of the files that it can write.
    """

    program: str
    package: str
    write: Callable[[SerialPort, Path], CommandLine]
    read: Callable[[SerialPort, Path], CommandLine] | None = None
    formats: tuple[str, ...] = (".hex", ".bin")


class Board(Record, frozen=True):
    """A board: its USB identifiers, its image in ``images.json``, and how it is programmed, the best way first.

    ``kept_bytes`` is how much of its flash memory a program may fill: a boot loader behind that is not backed up.
    ``is_start`` tells whether a program for this processor may begin with these bytes.
    """

    name: str
    title: str
    usb_ids: tuple[str, ...]
    image: str
    programmers: tuple[Programmer, ...]
    kept_bytes: int
    is_start: Callable[[bytes], bool]


def _is_cortex_start(data: bytes) -> bool:
    """A table of vectors: the stack's end in the 32 KiB of RAM, and the address of Thumb code."""
    stack, reset = (int.from_bytes(data[at : at + 4], "little") for at in (0, 4))
    return 0x2000_0000 < stack <= 0x2000_8000 and 8 <= reset < TIVA_FLASH_BYTES and reset % 2 == 1


def _is_avr_start(data: bytes) -> bool:
    """The vector of a reset: ``jmp`` or ``rjmp``."""
    word = int.from_bytes(data[:2], "little")
    return word & 0xFE0E == 0x940C or word & 0xF000 == 0xC000


def _avrdude(port: SerialPort) -> CommandLine:
    """ATmegaBOOT of the Duemilanove with an ATmega328P: STK500 at 57600 baud."""
    return ["avrdude", "-qq", "-c", "arduino", "-p", "m328p", "-P", port.device, "-b", "57600", "-D"]


def _format_of(file: Path) -> str:
    """As avrdude names the formats: Intel hex, or the bytes as they are."""
    return "i" if file.suffix == ".hex" else "r"


def _avrdude_write(port: SerialPort, file: Path) -> CommandLine:
    return [*_avrdude(port), "-U", f"flash:w:{file}:{_format_of(file)}"]  # verifies by itself


def _avrdude_read(port: SerialPort, file: Path) -> CommandLine:
    return [*_avrdude(port), "-U", f"flash:r:{file}:r"]


TIVA_FLASH_BYTES = 256 * 1024


def _openocd(port: SerialPort, *commands: str) -> CommandLine:
    """``commands`` are Tcl; a LaunchPad among several is chosen by its serial number."""
    chosen = [f"adapter serial {port.serial_number}"] if port.serial_number else []
    arguments = [argument for command in (*chosen, *commands) for argument in ("-c", command)]
    return ["openocd", "-f", "board/ti_ek-tm4c123gxl.cfg", *arguments]


def _openocd_write(port: SerialPort, file: Path) -> CommandLine:
    return _openocd(port, f"program {{{file}}} verify reset exit 0x0")


def _openocd_read(port: SerialPort, file: Path) -> CommandLine:
    read = f"dump_image {{{file}}} 0x0 {TIVA_FLASH_BYTES:#x}"
    return _openocd(port, "init", "reset halt", read, "reset run", "shutdown")


def _lm4flash_write(port: SerialPort, file: Path) -> CommandLine:
    chosen = ["-s", port.serial_number] if port.serial_number else []
    return ["lm4flash", "-v", *chosen, str(file)]


OPENOCD = Programmer("openocd", "openocd", _openocd_write, _openocd_read)
LM4FLASH = Programmer("lm4flash", "lm4flash", _lm4flash_write, formats=(".bin",))
"""It would write the letters of a .hex as they are."""

AVRDUDE = Programmer("avrdude", "avrdude", _avrdude_write, _avrdude_read)

TIVA = Board(
    "tiva",
    "Tiva-C LaunchPad (EK-TM4C123GXL)",
    ("1cbe:00fd",),
    "tm4c123",
    (OPENOCD, LM4FLASH),
    TIVA_FLASH_BYTES,
    _is_cortex_start,
)
DUEMILANOVE = Board(
    "duemilanove",
    "Arduino Duemilanove (ATmega328P)",
    ("0403:6001",),
    "atmega328p",
    (AVRDUDE,),
    0x7800,
    _is_avr_start,
)
"""The boot loader has the last 2 KiB of 32, and does not write itself."""

BOARDS = {board.name: board for board in (TIVA, DUEMILANOVE)}


def board_of(port: SerialPort) -> Board | None:
    """The board that has this port's USB identifier."""
    return next((board for board in BOARDS.values() if port.usb_id in board.usb_ids), None)


def choose(
    ports: Sequence[SerialPort], named_board: Board | None, *, port_was_named: bool
) -> tuple[Board, SerialPort]:
    """The board and its port.

    ``ports`` are the computer's, or the one that was named; ``named_board`` is the board that was named, if one was.

    Raises:
        LookupError: there is none, or more than one; the message says which, and what to give.
    """
    if port_was_named:
        (port,) = ports
        board = named_board or board_of(port)
        if board is None:
            what = (
                f"its USB identifier {port.usb_id} is no known board's"
                if port.usb_id
                else "it is no USB port"
            )
            raise LookupError(f"{port.device}: {what}; say which board it is with --board")
        return board, port
    plugged_in = [
        (board, port) for port in ports if (board := board_of(port)) and named_board in (None, board)
    ]
    if not plugged_in:
        names = (
            " or ".join(board.title for board in BOARDS.values())
            if named_board is None
            else named_board.title
        )
        raise LookupError(
            f"no {names} is plugged in; a board with another USB identifier is named with --board and --port"
        )
    if len(plugged_in) > 1:
        listed = ", ".join(f"{port.device} ({board.title})" for board, port in plugged_in)
        raise LookupError(f"{len(plugged_in)} boards are plugged in, say which with --port: {listed}")
    return plugged_in[0]
