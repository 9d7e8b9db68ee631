"""The firmware's core in a library of its own (`make -C firmware host`), on time that the test tells.

ctypes, not cffi: it comes with Python, so the tests have no dependency more, and nothing is compiled for Python. The
library has one board; a new ``Board`` is that board with its power switched on again.
"""

import ctypes
from binascii import crc_hqx
from collections.abc import Iterable, Mapping
from ctypes import c_bool, c_uint8, c_uint32
from functools import cache
from types import MappingProxyType

from chefbotd.components.simulation.compiled_firmware import FakeHal
from tests.firmware import tools

SOFTWARE, POWER_ON, PIN, BROWN_OUT, WATCHDOG, COMMAND, HUNG, DAMAGED = range(8)
"""Reset causes; the first is no hardware's: the firmware itself knows why."""

TURN = ((0, 2), (2, 3), (3, 1), (1, 0))
"""The levels before and after each edge of a wheel that rolls forward: A (2) before B (1)."""


@cache
def library() -> ctypes.CDLL:
    """The library, built if its sources are newer."""
    tools.make("host")
    return ctypes.CDLL(str(tools.BUILD / "libfirmware_host.so"))


def crc(body: bytes) -> int:
    """CRC-16 with polynomial 0x1021 and initial value 0xFFFF: the standard library's own."""
    return crc_hqx(body, 0xFFFF)


def seal(body: str) -> str:
    """A body with its CRC."""
    return f"{body}*{crc(body.encode()):04X}"


class Board:
    """The host build's board. Lines that it sends are read at once, as from a line without end of speed.

    ``sent`` are those since the power came on or `forget`, without their line ends.
    """

    def __init__(self, *, micros: int = 0, cause: int = POWER_ON, has_imu: bool = True) -> None:
        self._library = library()
        self.fake = FakeHal.in_dll(self._library, "fake")
        ctypes.memset(ctypes.byref(self.fake), 0, ctypes.sizeof(self.fake))
        self.fake.micros, self.fake.has_imu = micros, has_imu
        self._sequence = 0
        self.raw = b""
        self.start(cause)

    def start(self, cause: int) -> None:
        """Run the program from its beginning; what HAL_KEPT holds stays."""
        self._library.firmware_start(cause)
        self._drain()

    @property
    def kept_bits(self) -> int:
        """How many bits HAL_KEPT holds."""
        return 8 * int(self._library.host_kept_bytes())

    def damage(self, *bits: int) -> None:
        """Flip bits of what HAL_KEPT holds."""
        for bit in bits:
            self._library.host_flip_kept(bit)

    # What comes in

    def receive(self, data: bytes) -> None:
        """Bytes by the receive interrupt; the main loop has not seen them yet."""
        self._library.host_receive(data, len(data))

    def receive_early(self, data: bytes) -> None:
        """Bytes that come in while the program restarts itself."""
        for byte in data:
            self._library.firmware_received_early(byte)

    def receive_lost(self) -> None:
        """The UART lost a byte."""
        self._library.firmware_receive_lost()

    def write(self, text: str) -> None:
        """A line with its CR, and a pass of the main loop."""
        self.receive(text.encode("latin-1") + b"\r")
        self.step()

    def seal(self, body: str, sequence: int | None = None) -> int:
        """A sealed line with the next sequence number, or this one; gives that number."""
        number = self._sequence if sequence is None else sequence
        self._sequence = (number + 1) % 256
        self.write(seal(f"{body} {number}"))
        return number

    def hello(self, deadman_ms: int = 250) -> None:
        """Begin the checked mode, and forget the answer."""
        self.seal(f"hello 1 {deadman_ms}")
        self.forget()

    def edges(self, wheel: int, count: int) -> None:
        """So many edges of a wheel by its interrupt, forward or, if negative, back."""
        for _ in range(abs(count)):
            now = self.fake.levels[wheel]
            levels = [(after, before) if count > 0 else (before, after) for before, after in TURN]
            self.encoder(wheel, next(after for after, before in levels if before == now))

    def turn(self, wheel: int, count: int) -> None:
        """So many counts at once, within int16: what the interrupt's 16 bits have gone on by."""
        self._library.host_turn(wheel, count)

    def encoder(self, wheel: int, levels: int) -> None:
        """The pins of a wheel's encoder are so now."""
        self._library.host_encoder(wheel, levels)

    def echo(self, rising: bool) -> None:
        """The ultrasonic sensor's line rises or falls now."""
        self._library.firmware_echo(c_bool(rising), c_uint32(self.fake.micros))

    def measure(
        self,
        *,
        imu: Iterable[int] = (),
        battery: int | None = None,
        current: Mapping[int, int] = MappingProxyType({}),
    ) -> None:
        """New readings, taken now."""
        if counts := list(imu):
            self.fake.imu[:], self.fake.is_new_imu, self.fake.imu_us = counts, True, self.fake.micros
        if battery is not None:
            self.fake.battery, self.fake.is_new_battery = battery, True
        for wheel, adc in current.items():
            self.fake.current[wheel], self.fake.is_new_current[wheel] = adc, True

    # Time

    def run(self, seconds: float) -> None:
        """Passes each 100 us, and the tick at each whole millisecond that was run."""
        left_us = round(seconds * 10_000) * 100
        while left_us > 0:
            self.run_us(min(left_us, 1000))
            left_us -= 1000

    def run_us(self, micros: int) -> None:
        """The same for so many microseconds, a multiple of 100."""
        self._library.host_run(micros)
        self._drain()

    def step(self) -> None:
        """One pass of the main loop."""
        self._library.firmware_pass()
        self._drain()

    def tick(self) -> None:
        """One interrupt of the timer."""
        self._library.firmware_tick()

    def hold_up(self, milliseconds: int) -> None:
        """Ticks without a pass: the main loop has something else to do."""
        for _ in range(milliseconds):
            self.fake.micros = (self.fake.micros // 1000 + 1) * 1000
            self.tick()

    def watchdog(self) -> None:
        """The watchdog's interrupt."""
        self._library.firmware_watchdog()

    # What comes out

    @property
    def duty(self) -> tuple[int, int]:
        """What is on the motors."""
        left, right = self.fake.duty
        return left, right

    @property
    def sent(self) -> list[str]:
        """The lines since `forget`."""
        return [line for line in self.raw.decode().replace("\r", "").split("\n") if line]

    def bodies(self, kind: str = "") -> list[list[str]]:
        """The fields of sealed lines (of one kind), without sequence number and CRC, which have to be right."""
        fields = [body.split("\t")[:-1] for body in map(unsealed, self.sent)]
        return [body for body in fields if kind in ("", body[0])]

    def forget(self) -> None:
        """Look at later lines only."""
        self.raw = b""

    def drain(self, most: int) -> bytes:
        """At most so many bytes of those that wait to be sent, with `is_reading` off."""
        data = (c_uint8 * max(most, 1))()
        return bytes(data[: self._library.host_drain(data, most)])

    is_reading = True
    """Whether the host reads at once; else the ring fills until `drain`."""

    def _drain(self) -> None:
        if self.is_reading:
            self.raw += self.drain(4096)


def unsealed(line: str) -> str:
    """A sealed line's body; raises AssertionError if its CRC is wrong."""
    body, _, hexadecimal = line.rpartition("*")
    assert hexadecimal == f"{crc(body.encode()):04X}", line
    return body
