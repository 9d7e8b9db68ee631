"""The board's own program on an emulated ATmega328P: `firmware/emulators/simavr_board.h` by ctypes.

ctypes comes with Python, so a daemon that only simulates needs no compiler. ``make -C firmware boards emulators`` builds
the library and the image; both are looked for in one folder.
"""

import ctypes
from collections.abc import Callable
from ctypes import (
    POINTER,
    c_bool,
    c_char_p,
    c_double,
    c_int16,
    c_size_t,
    c_uint,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
)
from functools import cache
from pathlib import Path
from typing import NamedTuple

CYCLES_S = 16_000_000
LIBRARY, IMAGE = "libsimavr_board.so", "atmega328p.elf"
BUILD = Path(__file__).parents[3] / "firmware" / "build"
"""Where `make firmware` puts them, in the sources."""

MOST_TAKEN = 8192
BYTE_CYCLES = 1389
"""Ten bits at 115200 baud."""

READINGS = 6


class _Byte(ctypes.Structure):
    _fields_ = (("at_cycle", c_uint64), ("byte", c_uint64))


class _Duty(ctypes.Structure):
    _fields_ = (("at_cycle", c_uint64), ("left", c_int16), ("right", c_int16))


_ECHO = ctypes.CFUNCTYPE(c_uint32)
_IMU = ctypes.CFUNCTYPE(None, POINTER(c_int16))
_ARGUMENTS = {
    "close": (),
    "run": (c_uint64,),
    "cycle": (),
    "receive": (c_uint8, c_uint64),
    "turn": (c_uint, c_double, c_double, c_uint64, c_uint64),
    "set_battery_mv": (c_uint32,),
    "set_imu": (c_bool,),
    "hold_sda": (c_uint8,),
    "reset": (c_bool,),
    "take_bytes": (POINTER(_Byte), c_size_t),
    "take_duties": (POINTER(_Duty), c_size_t),
    "duty": (POINTER(c_int16),),
    "slept_cycles": (),
    "lost": (),
    "peek": (c_uint16,),
    "poke": (c_uint16, c_uint8),
}
_RESULTS = {
    "run": c_bool,
    "cycle": c_uint64,
    "take_bytes": c_size_t,
    "take_duties": c_size_t,
    "slept_cycles": c_uint64,
    "lost": c_uint32,
    "peek": c_uint8,
}


@cache
def _library(path: Path) -> ctypes.CDLL:
    loaded = ctypes.CDLL(str(path))
    loaded.board_open.argtypes, loaded.board_open.restype = (c_char_p, _ECHO, _IMU), ctypes.c_void_p
    for name, arguments in _ARGUMENTS.items():
        function = getattr(loaded, f"board_{name}")
        function.argtypes, function.restype = (ctypes.c_void_p, *arguments), _RESULTS.get(name)
    return loaded


class SentByte(NamedTuple):
    """A byte, and when its last bit has left."""

    at_cycle: int
    byte: int


class DutyChange(NamedTuple):
    """What the motor drivers get from a cycle on, -255 to 255."""

    at_cycle: int
    duty: tuple[int, int]


class SimavrBoard:
    """The board, powered on at cycle 0. ``echo_us`` and ``imu_counts`` are asked when the program reads the sensors.

    ``echo_us`` gives 0 where no echo comes back. ``received_cycle`` is when the last byte that was put on the wire is
    in.

    Raises:
        FileNotFoundError: library or image is missing; the message says what builds them.
        ValueError: the image is none.
    """

    def __init__(
        self,
        folder: Path = BUILD,
        *,
        image: str = IMAGE,
        echo_us: Callable[[], int] = lambda: 0,
        imu_counts: Callable[[], tuple[int, ...]] = lambda: (0,) * READINGS,
    ) -> None:
        missing = [name for name in (LIBRARY, image) if not (folder / name).is_file()]
        if missing:
            raise FileNotFoundError(
                f"{folder} lacks {' and '.join(missing)}: run `make -C firmware boards emulators` in chefbotd's sources "
                "(Debian: apt-get install gcc-avr avr-libc libsimavr-dev libelf-dev)"
            )

        def read_imu(readings: "ctypes._Pointer[c_int16]") -> None:
            for number, counts in enumerate(imu_counts()):
                readings[number] = counts

        self._library = _library(folder / LIBRARY)
        self._callbacks = _ECHO(echo_us), _IMU(read_imu)
        self._board = self._library.board_open(str(folder / image).encode(), *self._callbacks)
        if self._board is None:
            raise ValueError(f"{folder / image} is no image of an ATmega328P")
        self._bytes, self._duties = (_Byte * MOST_TAKEN)(), (_Duty * MOST_TAKEN)()
        self.received_cycle = 0
        self.reset(power_on=True)

    def __del__(self) -> None:
        if getattr(self, "_board", None) is not None:
            self._library.board_close(self._board)

    def reset(self, *, power_on: bool = False) -> None:
        """Pull the reset pin, or turn the power off and on, which leaves nothing in its memory."""
        self._library.board_reset(self._board, power_on)

    # Time

    @property
    def cycle(self) -> int:
        """Cycles since it was opened, resets or not."""
        return int(self._library.board_cycle(self._board))

    def run(self, to_cycle: int) -> None:
        """Run until then; raises ``RuntimeError`` when the program has crashed, or its output was not taken in time."""
        if not self._library.board_run(self._board, to_cycle):
            raise RuntimeError(f"the program has stopped at cycle {self.cycle}")
        if lost := self._library.board_lost(self._board):
            raise RuntimeError(f"{lost} events found their queue full: run it for less time at once")

    # What goes in

    def receive(self, data: bytes, at_cycle: int) -> None:
        """Bytes that begin to come in at this cycle, or behind those before, at 115200 baud."""
        for byte in data:
            at_cycle = self.received_cycle = max(at_cycle, self.received_cycle) + BYTE_CYCLES
            self._library.board_receive(self._board, byte, at_cycle)

    def turn(self, wheel: int, from_counts: float, to_counts: float, from_cycle: int, to_cycle: int) -> None:
        """Let a wheel turn evenly: angles in quadrature counts, forward positive."""
        self._library.board_turn(self._board, wheel, from_counts, to_counts, from_cycle, to_cycle)

    def set_battery_mv(self, millivolts: int) -> None:
        """The voltage at the battery's pin."""
        self._library.board_set_battery_mv(self._board, millivolts)

    def set_imu(self, present: bool) -> None:
        """Whether an IMU answers."""
        self._library.board_set_imu(self._board, present)

    # What comes out

    def hold_sda(self, clocks: int) -> None:
        """The MPU-6050 holds SDA low for so many clocks of SCL."""
        self._library.board_hold_sda(self._board, clocks)

    def take_bytes(self) -> list[SentByte]:
        """What was sent since the last call; some may be on the wire still."""
        count = self._library.board_take_bytes(self._board, self._bytes, MOST_TAKEN)
        return [SentByte(entry.at_cycle, entry.byte) for entry in self._bytes[:count]]

    def take_duties(self) -> list[DutyChange]:
        """The changes of the duty since the last call that have lasted 25 us at least; their times are within 50 us."""
        count = self._library.board_take_duties(self._board, self._duties, MOST_TAKEN)
        return [DutyChange(entry.at_cycle, (entry.left, entry.right)) for entry in self._duties[:count]]

    @property
    def duty(self) -> tuple[int, int]:
        """What the motor drivers get now, -255 to 255."""
        duty = (c_int16 * 2)()
        self._library.board_duty(self._board, duty)
        return duty[0], duty[1]

    @property
    def slept_cycles(self) -> int:
        """How long the processor has had nothing to do."""
        return int(self._library.board_slept_cycles(self._board))

    def peek(self, address: int) -> int:
        """A byte of the data memory."""
        return int(self._library.board_peek(self._board, address))

    def poke(self, address: int, value: int) -> None:
        """Set a byte of the data memory."""
        self._library.board_poke(self._board, address, value)
